/*
 * A thread that loads the library, reads, writes, reconstructs and draws with it, unloads it, and then ends: with the
 * context of the process, with one that works on this thread, and with one that has threads. No code of the library may
 * keep running, and code that runs at the end of the thread must still be in memory.
 *
 *     reload LIBRARY SCENE_FOLDER SCRATCH_FOLDER
 */
#include <dirent.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "vg.h"

/* The stack size that vg.h requires of a calling thread. */
enum { STACK_BYTES = 1 << 20 };

/* Names of views; four are enough. */
static const char *const names[4] = {"000", "001", "002", "003"};

static const char *library_path, *scene_path;
static char ply_path[4096];

/* Threads of this process. */
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

/* A joined thread no longer runs, but is listed until the kernel has removed it. */
static int threads_left(int expected) {
    const struct timespec millisecond = {0, 1000000};
    int wait;
    for (wait = 0; threads() != expected && wait < 2000; wait++) {
        nanosleep(&millisecond, NULL);
    }
    return threads();
}

static void check(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "not true: %s\n", what);
        exit(1);
    }
}

#define CHECK(condition) check((condition), #condition)

/* Looks up a function of the library; ISO C has no conversion from an object pointer to a function pointer. */
static void load(void *library, const char *name, void *function) {
    void *address = dlsym(library, name);
    CHECK(address != NULL);
    memcpy(function, &address, sizeof address);
}

#define LOAD(result, name, parameters) \
    result(*name) parameters;          \
    load(library, #name, &name)

/* `asked`: threads of the context; -1: no context. */
static void *use(void *asked) {
    int count = *(int *)asked, before = threads();
    vg_context_options settings;
    vg_context *context = NULL;
    vg_scene_options which;
    vg_scene *scene = NULL;
    vg_view views[4];
    vg_options options;
    vg_gaussians *car = NULL, *again = NULL;
    vg_render_options drawing;
    vg_image_target target;
    unsigned char *picture;
    size_t i;
    void *library = dlopen(library_path, RTLD_NOW | RTLD_LOCAL);
    CHECK(library != NULL);
    {
        LOAD(vg_status, vg_context_options_init, (vg_context_options *, size_t));
        LOAD(vg_status, vg_context_new, (const vg_context_options *, vg_context **, vg_error **));
        LOAD(void, vg_context_free, (vg_context *));
        LOAD(void, vg_default_context_free, (void));
        LOAD(vg_status, vg_scene_options_init, (vg_scene_options *, size_t));
        LOAD(vg_status, vg_transforms_open, (const char *, const vg_scene_options *, vg_scene **, vg_error **));
        LOAD(vg_status, vg_view_init, (vg_view *, size_t));
        LOAD(vg_status, vg_scene_get_view, (const vg_scene *, size_t, vg_view *, vg_error **));
        LOAD(void, vg_scene_free, (vg_scene *));
        LOAD(vg_status, vg_options_init, (vg_options *, size_t));
        LOAD(vg_status, vg_reconstruct,
             (const vg_view *, size_t, const vg_options *, vg_gaussians **, vg_report **, vg_error **));
        LOAD(vg_status, vg_gaussians_save_ply, (const vg_gaussians *, const char *, vg_error **));
        LOAD(vg_status, vg_gaussians_load_ply, (const char *, vg_gaussians **, vg_error **));
        LOAD(void, vg_gaussians_free, (vg_gaussians *));
        LOAD(vg_status, vg_render_options_init, (vg_render_options *, size_t));
        LOAD(vg_status, vg_image_target_init, (vg_image_target *, size_t));
        LOAD(vg_status, vg_render,
             (const vg_gaussians *, const vg_camera *, const vg_render_options *, const vg_image_target *,
              vg_error **));

        if (count >= 0) {
            CHECK(vg_context_options_init(&settings, sizeof settings) == VG_STATUS_OK);
            settings.threads = (uint32_t)count;
            CHECK(vg_context_new(&settings, &context, NULL) == VG_STATUS_OK);
            CHECK(threads() == before + (count == 1 ? 0 : count));
        }
        CHECK(vg_scene_options_init(&which, sizeof which) == VG_STATUS_OK);
        which.context = context;
        which.names = names;
        which.name_count = 4;
        CHECK(vg_transforms_open(scene_path, &which, &scene, NULL) == VG_STATUS_OK);
        for (i = 0; i < 4; i++) {
            CHECK(vg_view_init(&views[i], sizeof views[i]) == VG_STATUS_OK);
            CHECK(vg_scene_get_view(scene, i, &views[i], NULL) == VG_STATUS_OK);
        }
        CHECK(vg_options_init(&options, sizeof options) == VG_STATUS_OK);
        options.context = context;
        options.prior = VG_PRIOR_SHAPE;
        options.resolution = 0.25;
        CHECK(vg_reconstruct(views, 4, &options, &car, NULL, NULL) == VG_STATUS_OK);
        CHECK(vg_gaussians_save_ply(car, ply_path, NULL) == VG_STATUS_OK);
        CHECK(vg_gaussians_load_ply(ply_path, &again, NULL) == VG_STATUS_OK);
        CHECK(vg_render_options_init(&drawing, sizeof drawing) == VG_STATUS_OK);
        drawing.context = context;
        CHECK(vg_image_target_init(&target, sizeof target) == VG_STATUS_OK);
        target.width = views[0].camera.width;
        target.height = views[0].camera.height;
        picture = (unsigned char *)malloc((size_t)4 * target.width * target.height);
        target.color = picture;
        CHECK(vg_render(again, &views[0].camera, &drawing, &target, NULL) == VG_STATUS_OK);
        CHECK(count != 1 || threads() == before);

        free(picture);
        vg_gaussians_free(car);
        vg_gaussians_free(again);
        vg_scene_free(scene);
        vg_context_free(context);
        vg_default_context_free();
    }
    CHECK(threads_left(before) == before);
    dlclose(library);
    return NULL;
}

int main(int argc, char **argv) {
    static int asked[3] = {-1, 1, 2};
    int round;
    if (argc != 4) {
        return 2;
    }
    library_path = argv[1];
    scene_path = argv[2];
    snprintf(ply_path, sizeof ply_path, "%s/reload.ply", argv[3]);
    for (round = 0; round < 3; round++) {
        pthread_t thread;
        pthread_attr_t attributes;
        CHECK(pthread_attr_init(&attributes) == 0);
        CHECK(pthread_attr_setstacksize(&attributes, STACK_BYTES) == 0);
        CHECK(pthread_create(&thread, &attributes, use, &asked[round]) == 0);
        CHECK(pthread_attr_destroy(&attributes) == 0);
        CHECK(pthread_join(thread, NULL) == 0);
        CHECK(threads_left(1) == 1);
    }
    return 0;
}
