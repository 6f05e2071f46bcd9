// Front-to-back blending of one tile, one pixel per thread.

// The band's planes: colour [pixels][3], alpha [pixels], depth [pixels]. Between slices the plane of alpha holds the
// transmittance, negative where the pixel is finished. A picture of bytes uses the plane of depth only. The type is u32
// because not every bit pattern is preserved as a float.
@group(0) @binding(6) var<storage, read_write> picture: array<u32>;
// 1: a pixel is unfinished; 2: the driver ended a loop early.
@group(0) @binding(7) var<storage, read_write> unfinished: array<atomic<u32>>;

// `is_last` for a picture of bytes.
const BYTES: u32 = 2u;

// Rounds halves up and clamps at 255.
fn to_byte(v: f32) -> u32 {
    let x = min(v * 255.0, 255.0);
    let whole = floor(x);
    return u32(whole) + select(0u, 1u, x - whole >= 0.5);
}

// Red is the lowest byte. On a transparent background colour is divided by alpha; otherwise alpha is 255.
fn rgba8(color: vec3<f32>, alpha: f32) -> u32 {
    let is_opaque = frame.background.w != 0.0;
    let straight = select(0.0, 1.0 / max(alpha, 1e-30), alpha > 0.0);
    let c = color * select(straight, 1.0, is_opaque);
    let a = select(to_byte(alpha), 255u, is_opaque);
    return to_byte(c.x) | (to_byte(c.y) << 8u) | (to_byte(c.z) << 16u) | (a << 24u);
}

@compute @workgroup_size(PIXELS)
fn blend(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = group.x * TILE + lane % TILE;
    let row = group.y * TILE + lane / TILE;
    let y = frame.first_tile_row * TILE + row;
    let is_inside = x < frame.width && y < frame.height;
    let pixels = frame.width * min(frame.tile_rows * TILE, frame.height - frame.first_tile_row * TILE);
    let pixel = row * frame.width + x;

    // Transmittance, negative where the pixel is finished.
    var t = select(-1.0, 1.0, is_inside);
    var color = vec3(0.0);
    var depth = 0.0;
    if (frame.is_first == 0u && is_inside) {
        let rgb = vec3(picture[3u * pixel], picture[3u * pixel + 1u], picture[3u * pixel + 2u]);
        color = bitcast<vec3<f32>>(rgb);
        t = bitcast<f32>(picture[3u * pixels + pixel]);
        depth = bitcast<f32>(picture[4u * pixels + pixel]);
    }
    let center = vec2(f32(x), f32(y)) + 0.5;

    let range = ranges[group.y * frame.tile_columns + group.x];
    for (var begin = range.x; begin < range.y; begin += PIXELS) {
        if (!is_any_pixel_live(t > 0.0, lane)) {
            break;
        }
        let count = min(range.y - begin, PIXELS);
        load_batch(begin, count, lane);
        for (var k = 0u; k < count && t > 0.0; k++) {
            let s = batch[k];
            let alpha = splat_alpha(s, sheared_offset(s, center));
            if (alpha >= ALPHA_THRESHOLD) {
                let next = t * (1.0 - alpha);
                if (next > TRANSMITTANCE_THRESHOLD) {
                    // The decrease of t, which sums exactly to the 1 - t by which depth is divided.
                    let weight = t - next;
                    color += weight * batch_tints[k].xyz;
                    depth += weight * batch_tints[k].w;
                    t = next;
                } else {
                    t = -t;
                }
            }
        }
    }
    if (!is_inside) {
        return;
    }
    if (is_cut_short(frame.opaque_zero)) {
        atomicOr(&unfinished[0], 2u);
    }
    if (frame.is_last != 0u) {
        let rest = abs(t);
        let alpha = 1.0 - rest;
        color += rest * frame.background.xyz;
        if (frame.expected_depth != 0u) {
            depth = select(0.0, depth / max(alpha, 1e-30), alpha > 0.0);
        }
        if (frame.is_last == BYTES) {
            picture[4u * pixels + pixel] = rgba8(color, alpha);
            return;
        }
        t = alpha;
    } else if (t > 0.0) {
        atomicOr(&unfinished[0], 1u);
    }
    let rgb = bitcast<vec3<u32>>(color);
    picture[3u * pixel] = rgb.x;
    picture[3u * pixel + 1u] = rgb.y;
    picture[3u * pixel + 2u] = rgb.z;
    picture[3u * pixels + pixel] = bitcast<u32>(t);
    picture[4u * pixels + pixel] = bitcast<u32>(depth);
}
