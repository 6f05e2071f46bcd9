// A second file of the same program with everything that vg.hpp has.
#include "vg.hpp"

#include "vg.hpp"

std::size_t size_seen_by_the_other_file(const vg::Gaussians &gaussians);

std::size_t size_seen_by_the_other_file(const vg::Gaussians &gaussians) {
    return gaussians.size();
}
