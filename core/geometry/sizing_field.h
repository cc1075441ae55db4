#pragma once

#include "core/mesh/mesh.h"

namespace remesh {

/// The wanted edge length h(x) > 0 at every point of space. Lipschitz with constant `gradation()`.
class SizingField {
public:
    virtual ~SizingField() = default;

    /// Wanted edge length at a point, model units. Safe from any thread.
    [[nodiscard]] virtual double h(const Vec3& point) const = 0;
    /// Lower bound of h over a ball, model units; `h_max()` only if h is h_max all over it.
    [[nodiscard]] virtual double least_within(const Vec3& center, double radius) const = 0;
    [[nodiscard]] virtual double h_min() const = 0;      ///< Greatest lower bound of h.
    [[nodiscard]] virtual double h_max() const = 0;      ///< Least upper bound of h.
    [[nodiscard]] virtual double gradation() const = 0;  ///< |h(x) - h(y)| <= gradation |x - y|.
    [[nodiscard]] bool is_uniform() const { return h_min() == h_max(); }
};

/// The same h everywhere.
class UniformSizing final : public SizingField {
public:
    explicit UniformSizing(double h) : h_(h) {}

    [[nodiscard]] double h(const Vec3& /*point*/) const override { return h_; }
    [[nodiscard]] double least_within(const Vec3& /*center*/, double /*radius*/) const override {
        return h_;
    }
    [[nodiscard]] double h_min() const override { return h_; }
    [[nodiscard]] double h_max() const override { return h_; }
    [[nodiscard]] double gradation() const override { return 0.0; }

private:
    double h_;
};

}  // namespace remesh
