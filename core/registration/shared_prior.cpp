#include "core/registration/shared_prior.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <fmt/format.h>

namespace fluorocut {

namespace {
// An exactly known parameter; the parameters are relative lengths, px, mm and rad.
constexpr double kExact = 1e-9;
}  // namespace

Result<void> SharedPrior::validate() const {
    if (sigma.size() != size() || change_sigma.size() != size() || static_cast<Eigen::Index>(names.size()) != size()) {
        return invalidOption("shared parameters",
                             fmt::format("{} names, {} values, {} and {} standard deviations", names.size(), size(),
                                         sigma.size(), change_sigma.size()),
                             "as many of each");
    }
    for (Eigen::Index i = 0; i < size(); ++i) {
        const std::string& name = names[static_cast<std::size_t>(i)];
        if (!std::isfinite(mean[i])) return invalidOption(name, fmt::format("{}", mean[i]), "a number");
        if (!(sigma[i] >= 0)) return invalidOption(name + ", standard deviation", fmt::format("{}", sigma[i]), ">= 0");
        if (!(change_sigma[i] >= 0 && std::isfinite(change_sigma[i]))) {
            return invalidOption(name + ", standard deviation of its change", fmt::format("{}", change_sigma[i]),
                                 "a number >= 0");
        }
    }
    return {};
}

SharedLayout::SharedLayout(const SharedPrior& prior, std::size_t positions)
    : index(positions, std::vector<int>(static_cast<std::size_t>(prior.size()))) {
    int count = 0;
    std::vector<int> first(static_cast<std::size_t>(prior.size()));
    for (std::size_t p = 0; p < first.size(); ++p) {
        const bool own = prior.change_sigma[static_cast<Eigen::Index>(p)] > 0;
        first[p] = count;
        for (std::size_t k = 0; k < positions; ++k)
            index[k][p] = own ? count++ : count;
        if (!own) ++count;
    }
    mean.resize(count);
    information = Eigen::MatrixXd::Zero(count, count);
    for (std::size_t p = 0; p < first.size(); ++p) {
        const auto i = static_cast<Eigen::Index>(p);
        const Eigen::Index copies = prior.change_sigma[i] > 0 ? static_cast<Eigen::Index>(positions) : 1;
        mean.segment(first[p], copies).setConstant(prior.mean[i]);
        // (change^2 I + sigma^2 1 1^T)^-1 by Sherman and Morrison's formula; sigma infinite: its limit.
        const double change = prior.change_sigma[i], sigma = std::max(prior.sigma[i], kExact);
        Eigen::MatrixXd block = Eigen::MatrixXd::Identity(copies, copies);
        if (change > 0) {
            const double n = static_cast<double>(copies), c2 = change * change;
            const double share = std::isfinite(sigma) ? sigma * sigma / (c2 + n * sigma * sigma) : 1 / n;
            block = (block - Eigen::MatrixXd::Constant(copies, copies, share)) / c2;
        } else {
            block *= std::isfinite(sigma) ? 1 / (sigma * sigma) : 0;
        }
        information.block(first[p], first[p], copies, copies) = block;
    }
}

Eigen::VectorXd SharedLayout::valuesOf(const Eigen::VectorXd& all, std::size_t position) const {
    const std::vector<int>& of = index.at(position);
    Eigen::VectorXd values(static_cast<Eigen::Index>(of.size()));
    for (std::size_t p = 0; p < of.size(); ++p)
        values[static_cast<Eigen::Index>(p)] = all[of[p]];
    return values;
}

}  // namespace fluorocut
