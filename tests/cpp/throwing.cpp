// vg.hpp with VG_HPP_EXCEPTIONS, together with a file of the same program without. Prints nothing on success.
#define VG_HPP_EXCEPTIONS
#include "vg.hpp"

#include <cstdio>
#include <cstdlib>
#include <string>
#include <type_traits>

#define CHECK(...)                                                                                           \
    do {                                                                                                     \
        if (!(__VA_ARGS__)) {                                                                                \
            std::fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #__VA_ARGS__);                 \
            std::exit(1);                                                                                    \
        }                                                                                                    \
    } while (0)

// In the file without exceptions.
bool fails_quietly_in_the_other_file(const std::string &path);

namespace {

static_assert(std::is_base_of_v<std::runtime_error, vg::Exception>);

/// Whether this throws the error of the library.
template <class Call> bool throws(vg_status status, const char *words, const Call &call) {
    try {
        call();
    } catch (const vg::Exception &error) {
        return error.status() == status && std::string(error.what()).find(words) != std::string::npos;
    }
    return false;
}

void what_is_not_there_is_thrown() {
    const auto no_file = [] { return vg::Gaussians::load_ply("/nowhere.ply"); };
    CHECK(throws(VG_STATUS_IO, "/nowhere.ply", [&] { no_file().take(); }));
    CHECK(throws(VG_STATUS_IO, "/nowhere.ply", [&] { (void)no_file().value(); }));
    CHECK(throws(VG_STATUS_IO, "/nowhere.ply", [&] {
        const auto none = no_file();
        (void)none->size();
    }));
    CHECK(throws(VG_STATUS_IO, "/nowhere.ply", [&] {
        auto none = no_file();
        (void)*none;
    }));
    CHECK(throws(VG_STATUS_ARGUMENT, "gaussians", [] { vg::Gaussians().save_ply("none.ply").take(); }));
    CHECK(no_file().value_or(vg::Gaussians()).empty() && !no_file().ok());
    CHECK(vg::Context::make(1).take().threads() == 1);
}

} // namespace

int main() {
    what_is_not_there_is_thrown();
    CHECK(fails_quietly_in_the_other_file("/nowhere.ply"));
    return 0;
}
