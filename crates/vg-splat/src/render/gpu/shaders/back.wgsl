// Backward blending: a tile is blended once more, then traversed from its last layer to its first.
//
// With (gc, ga, gd) the gradient of a pixel, every layer k contributes T_k alpha_k phi_k to the loss, where
// phi_k = gc . colour + gd depth, and the background phi_end = gc . background - ga. S is the composite from a layer
// on, computed from the back:
//
//   S_k = alpha_k phi_k + (1 - alpha_k) S_{k+1},   dL/dalpha_k = T_k (phi_k - S_{k+1})
//
// The transmittance before a layer is that after it divided by 1 - alpha, which is at least 0.0001.
//
// First each thread handles a pixel and writes w = alpha dL/dalpha and T alpha of each layer to workgroup memory. Then
// it handles a quarter of a layer's pixels and adds them: one sum per pair, in the order of pixels, so that the result
// does not depend on the order of threads and no two threads add to one number.

// Gradient of the band's pixels: red, green, blue, alpha, depth.
@group(0) @binding(6) var<storage, read> gradient: array<f32>;
// [held_pairs][10]: w, w t, w s, w t t, w t s, w s s, red, green, blue, depth; (t, s) is the offset whitened, with
// q = t^2 + s^2.
@group(0) @binding(7) var<storage, read_write> shares: array<f32>;
// [tiles of the window][4]: the gradient of the background's colour, and whether the driver ended a loop early. Not
// vectors: threads must not write components of one vector concurrently.
@group(0) @binding(8) var<storage, read_write> backgrounds: array<f32>;

// Layers per iteration.
const LAYERS: u32 = 16u;
// Words between two layers' pixels, so that four layers use different banks.
const STRIDE: u32 = PIXELS + 4u;
const SUMS: u32 = 10u;

var<workgroup> batch_pairs: array<u32, LAYERS>;
// w and T alpha.
var<workgroup> weights: array<vec2<f32>, 1088>;
// Red, green, blue, depth of the pixels' gradients.
var<workgroup> upstream: array<vec4<f32>, PIXELS>;
// [LAYERS][4][SUMS]
var<workgroup> quarters: array<f32, 640>;
var<workgroup> last_layer: atomic<u32>;

fn pixel_center(group: vec2<u32>, lane: u32) -> vec2<f32> {
    let x = (frame.first_tile_column + group.x) * TILE + lane % TILE;
    let y = (frame.first_tile_row + group.y) * TILE + lane / TILE;
    return vec2(f32(x), f32(y)) + 0.5;
}

fn is_held(pair: u32) -> bool {
    // For a pair before the first, the difference wraps around to a huge number.
    return pair - frame.first_pair < frame.held_pairs;
}

@compute @workgroup_size(PIXELS)
fn back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let center = pixel_center(group.xy, lane);
    let x = u32(center.x);
    let y = u32(center.y);
    let is_inside = x < frame.width && y < frame.height;
    let tile = group.y * frame.tile_columns + group.x;
    let range = ranges[tile];

    // Forward pass, as in `blend`.
    var t = select(-1.0, 1.0, is_inside);
    var covered = 0.0;
    var total_depth = 0.0;
    // Slot after the last layer that was drawn.
    var end = range.x;
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
                    let weight = t * alpha;
                    covered += weight;
                    total_depth += weight * batch_tints[k].w;
                    t = next;
                    end = begin + k + 1u;
                } else {
                    t = -t;
                }
            }
        }
    }

    // Behind the last layer.
    t = abs(t);
    var toward = vec4(0.0);
    var behind = 0.0;
    if (is_inside) {
        let at = 5u * ((y - frame.band_row) * frame.width + x);
        toward = vec4(gradient[at], gradient[at + 1u], gradient[at + 2u], gradient[at + 4u]);
        behind = dot(toward.xyz, frame.background.xyz) - gradient[at + 3u];
        if (frame.expected_depth != 0u) {
            // d(D/A) = (dD - D/A dA) / A.
            let inverse = select(0.0, 1.0 / max(covered, 1e-30), covered > 0.0);
            toward.w *= inverse;
            behind += toward.w * (total_depth * inverse);
        }
    }
    workgroupBarrier();
    upstream[lane] = toward * select(0.0, t, is_inside);
    if (lane == 0u) {
        atomicStore(&last_layer, range.x);
    }
    workgroupBarrier();
    atomicMax(&last_layer, end);
    if (lane == 3u) {
        backgrounds[4u * tile + 3u] = 0.0;
    }
    if (lane < 3u) {
        var sum = 0.0;
        for (var p = 0u; p < PIXELS; p++) {
            sum += upstream[p][lane];
        }
        backgrounds[4u * tile + lane] = sum;
    }
    storageBarrier();
    workgroupBarrier();
    upstream[lane] = toward;
    if (lane == 0u) {
        shared_number = atomicLoad(&last_layer);
    }
    let last = workgroupUniformLoad(&shared_number);
    // Layers that no pixel sees.
    for (var slot = last + lane; slot < range.y; slot += PIXELS) {
        let pair = pair_from_slot[slot];
        if (is_held(pair)) {
            for (var j = 0u; j < SUMS; j++) {
                shares[(pair - frame.first_pair) * SUMS + j] = 0.0;
            }
        }
    }

    for (var stop = last; stop > range.x;) {
        let count = min(stop - range.x, LAYERS);
        let begin = stop - count;
        stop = begin;
        if (lane < count) {
            batch_pairs[lane] = pair_from_slot[begin + lane];
        }
        load_batch(begin, count, lane);
        for (var k = count; k > 0u;) {
            k--;
            var w = 0.0;
            var weight = 0.0;
            if (begin + k < end) {
                let s = batch[k];
                let alpha = splat_alpha(s, sheared_offset(s, center));
                if (alpha >= ALPHA_THRESHOLD) {
                    let tint = batch_tints[k];
                    let phi = dot(toward.xyz, tint.xyz) + toward.w * tint.w;
                    t = t / (1.0 - alpha);
                    weight = t * alpha;
                    if (alpha < frame.max_alpha) {
                        w = weight * (phi - behind);
                    }
                    behind = (1.0 - alpha) * behind + alpha * phi;
                }
            }
            weights[k * STRIDE + lane] = vec2(w, weight);
        }
        workgroupBarrier();

        let layer = lane / 4u;
        let quarter = lane % 4u;
        if (layer < count) {
            let s = batch[layer];
            // The shape and place of a huge, far-off splat get no gradient.
            let is_near = max(abs(s.rest_x), abs(s.rest_y)) < MAX_PIXELS;
            let whiten = select(vec2(0.0), vec2(sqrt(abs(s.conditional)), sqrt(s.marginal)), is_near);
            var sum: array<f32, SUMS>;
            for (var j = 0u; j < SUMS; j++) {
                sum[j] = 0.0;
            }
            for (var p = quarter; p < PIXELS; p += 4u) {
                let pixel = weights[layer * STRIDE + p];
                if (pixel.y > 0.0) {
                    let offset = whiten * sheared_offset(s, pixel_center(group.xy, p));
                    let w = pixel.x;
                    let wt = w * offset.x;
                    let ws = w * offset.y;
                    let g = pixel.y * upstream[p];
                    sum[0] += w;
                    sum[1] += wt;
                    sum[2] += ws;
                    sum[3] += wt * offset.x;
                    sum[4] += wt * offset.y;
                    sum[5] += ws * offset.y;
                    sum[6] += g.x;
                    sum[7] += g.y;
                    sum[8] += g.z;
                    sum[9] += g.w;
                }
            }
            for (var j = 0u; j < SUMS; j++) {
                quarters[lane * SUMS + j] = sum[j];
            }
        }
        workgroupBarrier();
        for (var i = lane; i < count * SUMS; i += PIXELS) {
            let k = i / SUMS;
            let j = i % SUMS;
            let pair = batch_pairs[k];
            if (is_held(pair)) {
                let q = k * 4u * SUMS + j;
                let sum = (quarters[q] + quarters[q + SUMS]) + (quarters[q + 2u * SUMS] + quarters[q + 3u * SUMS]);
                shares[(pair - frame.first_pair) * SUMS + j] = sum;
            }
        }
        workgroupBarrier();
    }
    if (is_cut_short(frame.opaque_zero)) {
        backgrounds[4u * tile + 3u] = 1.0;
    }
}
