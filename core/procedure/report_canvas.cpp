#include "core/procedure/report_canvas.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <numbers>

#include <cairo/cairo-pdf.h>
#include <pango/pangocairo.h>

namespace fluorocut {
namespace {

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
    return CAIRO_STATUS_SUCCESS;
}

// Pango asks for UTF-8; a name in another encoding is shown as far as it can be read.
std::string validUtf8(const std::string& text) {
    const std::unique_ptr<char, decltype(&g_free)> valid(
        g_utf8_make_valid(text.data(), static_cast<gssize>(text.size())), g_free);
    return valid.get();
}

struct Unref {
    void operator()(PangoLayout* layout) const { g_object_unref(layout); }
};
using Layout = std::unique_ptr<PangoLayout, Unref>;

}  // namespace

struct ReportCanvas::Inside {
    std::string pdf;  // written to while the surface lives
    double width = 0, height = 0;
    cairo_surface_t* surface = nullptr;
    cairo_t* cairo = nullptr;

    Inside() = default;
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;
    ~Inside() {
        cairo_destroy(cairo);
        cairo_surface_destroy(surface);
    }
    void begin(cairo_surface_t* on) {
        surface = on;
        cairo = cairo_create(on);
        if (cairo_status(cairo) != CAIRO_STATUS_SUCCESS) throw std::bad_alloc();
    }
    void color(const ReportColor& c, double opacity = 1) const {
        cairo_set_source_rgba(cairo, c[0] / 255.0, c[1] / 255.0, c[2] / 255.0, opacity);
    }
    Layout layout(const std::string& text, const TextLook& look, double in_width) const {
        Layout made(pango_cairo_create_layout(cairo));
        PangoFontDescription* font = pango_font_description_from_string("DejaVu Sans, sans-serif");
        pango_font_description_set_absolute_size(font, look.size * PANGO_SCALE);
        if (look.bold) pango_font_description_set_weight(font, PANGO_WEIGHT_BOLD);
        pango_layout_set_font_description(made.get(), font);
        pango_font_description_free(font);
        if (in_width > 0) {
            pango_layout_set_width(made.get(), static_cast<int>(std::ceil(in_width * PANGO_SCALE)));
            pango_layout_set_wrap(made.get(), PANGO_WRAP_WORD_CHAR);
            pango_layout_set_line_spacing(made.get(), 1.12F);
        }
        if (look.right) pango_layout_set_alignment(made.get(), PANGO_ALIGN_RIGHT);
        const std::string valid = validUtf8(text);
        pango_layout_set_text(made.get(), valid.data(), static_cast<int>(valid.size()));
        return made;
    }
    static TextSize size(PangoLayout* layout) {
        PangoRectangle logical;
        pango_layout_get_extents(layout, nullptr, &logical);
        return {static_cast<double>(logical.width) / PANGO_SCALE, static_cast<double>(logical.height) / PANGO_SCALE,
                static_cast<double>(pango_layout_get_baseline(layout)) / PANGO_SCALE};
    }
};

ReportCanvas::ReportCanvas(std::unique_ptr<Inside> inside) : inside_(std::move(inside)) {}
ReportCanvas::~ReportCanvas() = default;
ReportCanvas::ReportCanvas(ReportCanvas&&) noexcept = default;

ReportCanvas ReportCanvas::pages(double width, double height) {
    auto inside = std::make_unique<Inside>();
    inside->width = width;
    inside->height = height;
    inside->begin(cairo_pdf_surface_create_for_stream(append, &inside->pdf, width, height));
    return ReportCanvas(std::move(inside));
}

ReportCanvas ReportCanvas::pixels(int width, int height) {
    auto inside = std::make_unique<Inside>();
    inside->width = width;
    inside->height = height;
    inside->begin(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
    return ReportCanvas(std::move(inside));
}

TextSize ReportCanvas::sizeOf(const std::string& text, const TextLook& look, double width) const {
    return Inside::size(inside_->layout(text, look, width).get());
}

double ReportCanvas::widestWord(const std::string& text, const TextLook& look) const {
    double widest = 0;
    for (std::size_t from = 0; from < text.size();) {
        const std::size_t to = std::min(text.find(' ', from), text.size());
        widest = std::max(widest, sizeOf(text.substr(from, to - from), look).width);
        from = to + 1;
    }
    return widest;
}

TextSize ReportCanvas::text(const std::string& text, const TextLook& look, double x, double y, double width) {
    const Layout layout = inside_->layout(text, look, width);
    inside_->color(look.color);
    cairo_move_to(inside_->cairo, x, y);
    pango_cairo_show_layout(inside_->cairo, layout.get());
    return Inside::size(layout.get());
}

void ReportCanvas::line(double x1, double y1, double x2, double y2, const ReportColor& color, double width,
                        bool dashed) {
    cairo_t* cairo = inside_->cairo;
    const double dash[] = {3 * width, 2 * width};
    cairo_set_dash(cairo, dash, dashed ? 2 : 0, 0);
    inside_->color(color);
    cairo_set_line_width(cairo, width);
    cairo_move_to(cairo, x1, y1);
    cairo_line_to(cairo, x2, y2);
    cairo_stroke(cairo);
    cairo_set_dash(cairo, nullptr, 0, 0);
}

void ReportCanvas::rectangle(double x, double y, double width, double height, const ReportColor& color,
                             double opacity) {
    inside_->color(color, opacity);
    cairo_rectangle(inside_->cairo, x, y, width, height);
    cairo_fill(inside_->cairo);
}

void ReportCanvas::circle(double x, double y, double radius, const ReportColor& color) {
    inside_->color(color);
    cairo_new_path(inside_->cairo);
    cairo_arc(inside_->cairo, x, y, radius, 0, 2 * std::numbers::pi);
    cairo_fill(inside_->cairo);
}

void ReportCanvas::picture(const Image& grey, const std::vector<ReportCurve>& curves, double x, double y, double width,
                           double line_width) {
    cairo_t* cairo = inside_->cairo;
    const double scale = width / grey.width();
    cairo_surface_t* pixels = cairo_image_surface_create(CAIRO_FORMAT_RGB24, grey.width(), grey.height());
    if (cairo_surface_status(pixels) != CAIRO_STATUS_SUCCESS) throw std::bad_alloc();
    unsigned char* data = cairo_image_surface_get_data(pixels);
    const std::ptrdiff_t stride = cairo_image_surface_get_stride(pixels);
    for (int row = 0; row < grey.height(); ++row) {
        auto* out = reinterpret_cast<std::uint32_t*>(data + row * stride);  // aligned by cairo
        for (int column = 0; column < grey.width(); ++column) {
            const auto level = static_cast<std::uint32_t>(std::lround(std::clamp(grey(column, row), 0.F, 255.F)));
            out[column] = level << 16 | level << 8 | level;
        }
    }
    cairo_surface_mark_dirty(pixels);
    cairo_save(cairo);
    cairo_translate(cairo, x, y);
    cairo_scale(cairo, scale, scale);
    cairo_rectangle(cairo, 0, 0, grey.width(), grey.height());
    cairo_clip(cairo);
    cairo_set_source_surface(cairo, pixels, 0, 0);
    cairo_paint(cairo);
    cairo_surface_destroy(pixels);
    cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_width(cairo, line_width / scale);
    for (const ReportCurve& curve : curves) {
        const CurveLook& look = lookOf(curve.kind);
        const double dash[] = {4 * line_width / scale, 2.5 * line_width / scale};
        cairo_set_dash(cairo, dash, look.dashed ? 2 : 0, 0);
        // Pixel centres are at integers, the picture's corner at (-0.5, -0.5).
        for (const Vector2& p : curve.points)
            cairo_line_to(cairo, p.x() + 0.5, p.y() + 0.5);
        inside_->color(look.color);
        cairo_stroke(cairo);
    }
    cairo_restore(cairo);
}

void ReportCanvas::nextPage() {
    cairo_show_page(inside_->cairo);
}

void ReportCanvas::bookmark(const std::string& title, int page) {
    const std::string place = "page=" + std::to_string(page) + " pos=[0 0]";
    cairo_pdf_surface_add_outline(inside_->surface, CAIRO_PDF_OUTLINE_ROOT, validUtf8(title).c_str(), place.c_str(),
                                  CAIRO_PDF_OUTLINE_FLAG_OPEN);
}

void ReportCanvas::describe(const std::string& title, const std::string& author) {
    cairo_pdf_surface_set_metadata(inside_->surface, CAIRO_PDF_METADATA_TITLE, validUtf8(title).c_str());
    cairo_pdf_surface_set_metadata(inside_->surface, CAIRO_PDF_METADATA_AUTHOR, validUtf8(author).c_str());
}

Result<std::string> ReportCanvas::finishPdf() {
    cairo_surface_finish(inside_->surface);
    const cairo_status_t status = cairo_surface_status(inside_->surface);
    if (status != CAIRO_STATUS_SUCCESS)
        return outputFailed("PDF", std::string("pages that cannot be written: ") + cairo_status_to_string(status));
    return inside_->pdf;
}

ColorImage ReportCanvas::image() const {
    cairo_surface_flush(inside_->surface);
    const int width = cairo_image_surface_get_width(inside_->surface);
    const int height = cairo_image_surface_get_height(inside_->surface);
    const unsigned char* data = cairo_image_surface_get_data(inside_->surface);
    const std::ptrdiff_t stride = cairo_image_surface_get_stride(inside_->surface);
    ColorImage image(width, height);
    for (int y = 0; y < height; ++y) {
        const auto* row = reinterpret_cast<const std::uint32_t*>(data + y * stride);
        for (int x = 0; x < width; ++x) {
            image(x, y) = {static_cast<std::uint8_t>(row[x] >> 16), static_cast<std::uint8_t>(row[x] >> 8),
                           static_cast<std::uint8_t>(row[x])};
        }
    }
    return image;
}

}  // namespace fluorocut
