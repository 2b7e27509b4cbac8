#pragma once

#include <cmath>
#include <optional>

#include "muon.hpp"

namespace deepmuon {

// Where a muon enters a box, in metres from its centre, z up.
struct Entry {
    double x, y, z;
};

// A box whose edges lie along x, y and z, with these widths in metres. It takes the flux through a sphere, which a family
// has: deepmuon-bake --surface sphere makes a model of it.
class Box {
public:
    Box(double x, double y, double z) : x_(x), y_(y), z_(z) {}

    // No shadow of the box is larger, in m2. In a time T as many muons as T x rate x this are tried on average, with the
    // rate per m2 of the sphere's flux; so tries / (rate x this) is the time that they stand for.
    double largest_area() const { return std::hypot(y_ * z_, x_ * z_, x_ * y_); }

    // Tries a muon: it is taken as often as the box's shadow across its direction is large, and enters anywhere on it
    // alike. uniform() gives numbers in [0, 1).
    template <class Uniform> std::optional<Entry> enter(const Muon& muon, Uniform&& uniform) const {
        double left = largest_area() * uniform();
        const double first = uniform() - 0.5, second = uniform() - 0.5;
        if ((left -= x_ * y_ * -muon.w) < 0) {
            return Entry{x_ * first, y_ * second, z_ / 2};
        }
        if ((left -= y_ * z_ * std::fabs(muon.u)) < 0) {
            return Entry{std::copysign(x_ / 2, -muon.u), y_ * first, z_ * second};
        }
        if ((left -= x_ * z_ * std::fabs(muon.v)) < 0) {
            return Entry{x_ * first, std::copysign(y_ / 2, -muon.v), z_ * second};
        }
        return std::nullopt;
    }

private:
    double x_, y_, z_;
};

} // namespace deepmuon
