// What all tiles have for a splat: its pairs follow each other, and one thread adds up one number of them in their order.

struct Chunk {
    // Of the Gaussians whose sums these are.
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
// How many splats are drawn.
@group(0) @binding(2) var<storage, read> counter: array<u32>;
// Splats in order of depth.
@group(0) @binding(3) var<storage, read> order: array<u32>;
// By rank in depth: where a splat's pairs begin.
@group(0) @binding(4) var<storage, read> offsets: array<u32>;
// [held_pairs][10], from `first_pair` on.
@group(0) @binding(5) var<storage, read> shares: array<f32>;
@group(0) @binding(6) var<storage, read> splats: array<Splat>;
@group(0) @binding(7) var<storage, read> tints: array<vec4<f32>>;
// [count][10], then [count]: 1 for a form whose pivot is x, and 2, 4, 8 for channels of colour that are not cut; last
// whether the driver left a loop before its end.
@group(0) @binding(8) var<storage, read_write> sums: array<f32>;

const SUMS: u32 = 10u;

@compute @workgroup_size(256)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let drawn = counter[0];
    if (offsets[drawn] > frame.pair_capacity) {
        // The pairs did not fit, and what is listed is not the picture.
        return;
    }
    for (var i = id.x; i < drawn * (SUMS + 1u); i += 256u * groups.x) {
        let rank = i / (SUMS + 1u);
        let j = i % (SUMS + 1u);
        let splat = order[rank];
        let at = splat - chunk.first;
        if (at >= chunk.count) {
            continue;
        }
        if (j < SUMS) {
            let begin = max(offsets[rank], frame.first_pair) - frame.first_pair;
            let end = min(max(offsets[rank + 1u], frame.first_pair) - frame.first_pair, frame.held_pairs);
            var sum = sums[at * SUMS + j];
            for (var e = begin; e < end; e++) {
                sum += shares[e * SUMS + j];
            }
            sums[at * SUMS + j] = sum;
        } else {
            let color = tints[splat].xyz;
            var flags = select(0.0, 1.0, splats[splat].conditional < 0.0);
            flags += select(0.0, 2.0, color.x > 0.0 && color.x < MAX_COLOR);
            flags += select(0.0, 4.0, color.y > 0.0 && color.y < MAX_COLOR);
            flags += select(0.0, 8.0, color.z > 0.0 && color.z < MAX_COLOR);
            sums[SUMS * chunk.count + at] = flags;
        }
    }
    if (is_cut_short(frame.nothing)) {
        sums[(SUMS + 1u) * chunk.count] = 1.0;
    }
}
