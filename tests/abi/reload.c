/*
 * Loads the library, lets it start threads, and unloads it, three times over: nothing of it may be left running.
 *
 *     reload LIBRARY
 */
#include <dirent.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "vg.h"

static int threads(void) {
    int count = 0;
    struct dirent *entry;
    DIR *tasks = opendir("/proc/self/task");
    while (tasks != NULL && (entry = readdir(tasks)) != NULL) {
        count += entry->d_name[0] != '.';
    }
    if (tasks != NULL) {
        closedir(tasks);
    }
    return count;
}

/* A function of the library; ISO C knows no conversion from an object's address to a function's. */
static void load(void *library, const char *name, void *function) {
    void *address = dlsym(library, name);
    memcpy(function, &address, sizeof address);
}

int main(int argc, char **argv) {
    static const float position[3] = {1, 2, 3}, scale[3] = {0.1f, 0.1f, 0.1f}, rotation[4] = {1, 0, 0, 0};
    static const float opacity[1] = {1}, sh[3] = {0, 0, 0};
    const struct timespec millisecond = {0, 1000000};
    int round, wait;
    for (round = 0; round < 3; round++) {
        vg_status (*make)(const vg_context_options *, vg_context **, vg_error **);
        vg_status (*from_arrays)(const vg_gaussian_arrays *, vg_gaussians **, vg_error **);
        vg_status (*mirror)(const vg_gaussians *, vg_gaussians **, vg_error **);
        void (*end)(vg_context *), (*drop)(vg_gaussians *);
        vg_gaussian_arrays arrays;
        vg_context *context = NULL;
        vg_gaussians *one = NULL, *mirrored = NULL;
        void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : NULL;
        if (library == NULL) {
            fprintf(stderr, "%s\n", dlerror());
            return 1;
        }
        load(library, "vg_context_new", &make);
        load(library, "vg_context_free", &end);
        load(library, "vg_gaussians_from_arrays", &from_arrays);
        load(library, "vg_gaussians_mirror", &mirror);
        load(library, "vg_gaussians_free", &drop);
        memset(&arrays, 0, sizeof arrays);
        arrays.struct_size = sizeof arrays;
        arrays.count = 1;
        arrays.positions = position;
        arrays.scales = scale;
        arrays.rotations = rotation;
        arrays.opacities = opacity;
        arrays.sh = sh;
        if (make(NULL, &context, NULL) != VG_STATUS_OK || threads() < 2) {
            return 2;
        }
        if (from_arrays(&arrays, &one, NULL) != VG_STATUS_OK || mirror(one, &mirrored, NULL) != VG_STATUS_OK) {
            return 3;
        }
        drop(one);
        drop(mirrored);
        end(context);
        /* A thread that was joined runs nothing any more, but is listed until the kernel has buried it. */
        for (wait = 0; threads() != 1 && wait < 2000; wait++) {
            nanosleep(&millisecond, NULL);
        }
        if (threads() != 1) {
            return 4;
        }
        dlclose(library);
    }
    return 0;
}
