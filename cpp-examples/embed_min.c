/*
 * The shortest complete program: reads the first views of a scene, makes the model, renders it from the next
 * view, and writes a PPM. It needs only the C library and libvg.
 *
 *     embed_min SCENE COUNT OUT.ppm        e.g.: embed_min tests/data/sedan 4 unseen.ppm
 */
#include <stdio.h>
#include <stdlib.h>

#include "vg.h"

/* Every call that can fail returns a status, and an error with a message that the caller frees. */
static void must(vg_status status, vg_error *error) {
    if (status != VG_STATUS_OK) {
        fprintf(stderr, "embed_min: %s\n", vg_error_message(error));
        vg_error_free(error);
        exit(1);
    }
}

int main(int argc, char **argv) {
    vg_scene *scene = NULL;
    vg_gaussians *car = NULL;
    vg_error *error = NULL;

    if (argc != 4) {
        fprintf(stderr, "usage: embed_min SCENE COUNT OUT.ppm\n");
        return 2;
    }
    const size_t count = strtoul(argv[2], NULL, 10);
    must(vg_transforms_open(argv[1], NULL, &scene, &error), error);
    if (count < 1 || count >= vg_scene_view_count(scene)) {
        fprintf(stderr, "embed_min: COUNT: %s; allowed: 1 to %zu\n", argv[2], vg_scene_view_count(scene) - 1);
        return 2;
    }

    /* A view: photograph, mask, depth if there is one, lens and pose. Here it points into the scene; it
     * could also point to a camera driver's memory. */
    vg_view *views = calloc(count + 1, sizeof *views);
    for (size_t i = 0; i <= count; i++) {
        vg_view_init(&views[i], sizeof views[i]);
        must(vg_scene_get_view(scene, i, &views[i], &error), error);
    }
    must(vg_reconstruct(views, count, NULL, &car, NULL, &error), error);
    printf("%zu Gaussians\n", vg_gaussians_count(car));

    const vg_camera *camera = &views[count].camera;
    unsigned char *rgb = malloc((size_t)camera->width * camera->height * 3);
    vg_image_target target;
    vg_image_target_init(&target, sizeof target);
    target.width = camera->width;
    target.height = camera->height;
    target.color = rgb;
    target.color_format = VG_FORMAT_RGB8;
    must(vg_render(car, camera, NULL, &target, &error), error);

    FILE *file = fopen(argv[3], "wb");
    if (file == NULL) {
        perror(argv[3]);
        return 1;
    }
    fprintf(file, "P6 %u %u 255\n", camera->width, camera->height);
    fwrite(rgb, 3, (size_t)camera->width * camera->height, file);
    if (fclose(file) != 0) {
        perror(argv[3]);
        return 1;
    }

    free(rgb);
    free(views);
    vg_gaussians_free(car);
    vg_scene_free(scene);
    return 0;
}
