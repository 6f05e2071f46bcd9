// Sums of each splat's shares over all tiles: its pairs are consecutive, and one thread adds one component of them in
// their order.

struct Chunk {
    // Range of the Gaussians of these sums.
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
// Number of splats drawn.
@group(0) @binding(2) var<storage, read> counter: array<u32>;
// Splat at each depth rank.
@group(0) @binding(3) var<storage, read> splat_from_rank: array<u32>;
// First pair of the splat at each depth rank.
@group(0) @binding(4) var<storage, read> offsets: array<u32>;
// [held_pairs][10], from `first_pair` on.
@group(0) @binding(5) var<storage, read> shares: array<f32>;
@group(0) @binding(6) var<storage, read> splats: array<Splat>;
@group(0) @binding(7) var<storage, read> tints: array<vec4<f32>>;
// [count][10], then [count]: 1 for an exponent whose pivot is x, and 2, 4, 8 for channels of colour that are not
// clamped; last, whether the driver ended a loop early.
@group(0) @binding(8) var<storage, read_write> sums: array<f32>;

const SUMS: u32 = 10u;

@compute @workgroup_size(256)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let drawn = counter[0];
    if (offsets[drawn] > frame.pair_capacity) {
        // The pairs did not fit, so the lists are incomplete.
        return;
    }
    for (var i = id.x; i < drawn * (SUMS + 1u); i += 256u * groups.x) {
        let rank = i / (SUMS + 1u);
        let j = i % (SUMS + 1u);
        let splat = splat_from_rank[rank];
        let at = splat - chunk.first;
        if (at >= chunk.count) {
            continue;
        }
        if (j < SUMS) {
            let begin = max(offsets[rank], frame.first_pair) - frame.first_pair;
            let end = min(max(offsets[rank + 1u], frame.first_pair) - frame.first_pair, frame.held_pairs);
            var sum = sums[at * SUMS + j];
            for (var pair = begin; pair < end; pair++) {
                sum += shares[pair * SUMS + j];
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
    if (is_cut_short(frame.opaque_zero)) {
        sums[(SUMS + 1u) * chunk.count] = 1.0;
    }
}
