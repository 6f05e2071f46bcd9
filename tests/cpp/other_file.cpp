// A second file of the same program that uses everything in vg.hpp.
#include "vg.hpp"

#include "vg.hpp"

std::size_t size_seen_by_the_other_file(const vg::Gaussians &gaussians);
bool fails_quietly_in_the_other_file(const std::string &path);

std::size_t size_seen_by_the_other_file(const vg::Gaussians &gaussians) {
    return gaussians.size();
}

bool fails_quietly_in_the_other_file(const std::string &path) {
    const auto none = vg::Gaussians::load_ply(path);
    static_assert(noexcept(none.value()), "nothing is thrown here");
    return !none && none.error().status == VG_STATUS_IO;
}
