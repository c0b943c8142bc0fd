#include "app/cli/figures/canvas.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

namespace fluorocut::cli {
namespace {

constexpr int kFraction = 4;  // binary digits of a coordinate's fraction

cv::Scalar scalar(Color color) {
    return {double(color[0]), double(color[1]), double(color[2])};
}

cv::Point fixedPoint(const Vector2& p) {
    const double limit = 1 << 20;
    return {cvRound(std::clamp(p.x(), -limit, limit) * (1 << kFraction)),
            cvRound(std::clamp(p.y(), -limit, limit) * (1 << kFraction))};
}

}  // namespace

struct Canvas::Pixels {
    cv::Mat mat;  // red, green, blue
};

Canvas::Canvas(int width, int height, Color background)
    : pixels_(std::make_unique<Pixels>(Pixels{cv::Mat(height, width, CV_8UC3, scalar(background))})) {}
Canvas::~Canvas() = default;
Canvas::Canvas(Canvas&&) noexcept = default;
Canvas& Canvas::operator=(Canvas&&) noexcept = default;

void Canvas::picture(const Image& values, const Vector2& at, double scale) {
    cv::Mat grey(values.height(), values.width(), CV_8U);
    for (int y = 0; y < values.height(); ++y) {
        for (int x = 0; x < values.width(); ++x) {
            const float value = values(x, y);
            grey.at<std::uint8_t>(y, x) =
                static_cast<std::uint8_t>(255 * (value > 0 ? std::min(value, 1.0F) : 0) + 0.5F);
        }
    }
    const cv::Matx23d canvas_from_picture(scale, 0, at.x(), 0, scale, at.y());
    cv::Mat color;
    cv::cvtColor(grey, color, cv::COLOR_GRAY2RGB);
    cv::Mat mask(grey.size(), CV_8U, cv::Scalar(255)), placed, placed_mask;
    // Shrinking by area, so that fine lines do not alias.
    if (scale < 1) {
        const cv::Size size(std::max(1, cvRound(scale * grey.cols)), std::max(1, cvRound(scale * grey.rows)));
        cv::resize(color, color, size, 0, 0, cv::INTER_AREA);
        cv::resize(mask, mask, size, 0, 0, cv::INTER_NEAREST);
        const cv::Matx23d shift(1, 0, at.x() - 0.5 * scale + 0.5, 0, 1, at.y() - 0.5 * scale + 0.5);
        cv::warpAffine(color, placed, shift, pixels_->mat.size(), cv::INTER_LINEAR);
        cv::warpAffine(mask, placed_mask, shift, pixels_->mat.size(), cv::INTER_NEAREST);
    } else {
        cv::warpAffine(color, placed, canvas_from_picture, pixels_->mat.size(), cv::INTER_LINEAR);
        cv::warpAffine(mask, placed_mask, canvas_from_picture, pixels_->mat.size(), cv::INTER_NEAREST);
    }
    placed.copyTo(pixels_->mat, placed_mask);
}

void Canvas::curve(std::span<const Vector2> points, Color color, int thickness) {
    std::vector<cv::Point> corners;
    const auto draw = [&] {
        if (corners.size() > 1)
            cv::polylines(pixels_->mat, corners, false, scalar(color), thickness, cv::LINE_AA, kFraction);
        corners.clear();
    };
    for (const Vector2& point : points) {
        if (point.allFinite()) {
            corners.push_back(fixedPoint(point));
        } else {
            draw();
        }
    }
    draw();
}

void Canvas::arrow(const Vector2& from, const Vector2& to, Color color) {
    curve(std::array{from, to}, color);
    const Vector2 along = to - from;
    const double length = along.norm();
    if (!(length > 3)) return;
    const Vector2 back = -std::min(5.0, 0.4 * length) * along / length;
    const Vector2 side(-0.5 * back.y(), 0.5 * back.x());
    curve(std::array<Vector2, 3>{to + back + side, to, to + back - side}, color);
}

void Canvas::dot(const Vector2& center, double radius, Color color) {
    cv::circle(pixels_->mat, fixedPoint(center), cvRound(radius * (1 << kFraction)), scalar(color), cv::FILLED,
               cv::LINE_AA, kFraction);
}

void Canvas::frame(const Vector2& corner, const Vector2& size, Color color) {
    const Vector2 right(size.x(), 0), down(0, size.y());
    curve(std::array<Vector2, 5>{corner, corner + right, corner + size, corner + down, corner}, color);
}

void Canvas::text(const Vector2& at, const std::string& words, double height, Color color) {
    // The font's capitals are 21 units tall, descenders aside.
    cv::putText(pixels_->mat, words, {cvRound(at.x()), cvRound(at.y())}, cv::FONT_HERSHEY_SIMPLEX, height / 21,
                scalar(color), 1, cv::LINE_AA);
}

ColorImage Canvas::image() const {
    const cv::Mat& mat = pixels_->mat;
    ColorImage image(mat.cols, mat.rows);
    for (int y = 0; y < mat.rows; ++y) {
        for (int x = 0; x < mat.cols; ++x) {
            const cv::Vec3b& pixel = mat.at<cv::Vec3b>(y, x);
            image(x, y) = {pixel[0], pixel[1], pixel[2]};
        }
    }
    return image;
}

}  // namespace fluorocut::cli
