// Tiles that a splat touches: by the exact ellipse where alpha reaches 1/255, a row of tiles at a time.

@group(0) @binding(0) var<uniform> frame: Frame;
// Number of splats drawn.
@group(0) @binding(1) var<storage, read> counter: array<u32>;
// Splat at each depth rank.
@group(0) @binding(2) var<storage, read> splat_from_rank: array<u32>;
@group(0) @binding(3) var<storage, read> splats: array<Splat>;
// By depth rank: the number of the splat's pairs, then the first of them.
@group(0) @binding(4) var<storage, read_write> offsets: array<u32>;
// Tile and splat of each pair, in depth order.
@group(0) @binding(5) var<storage, read_write> tile_from_pair: array<u32>;
@group(0) @binding(6) var<storage, read_write> splat_from_pair: array<u32>;
// Depth rank at which the slice ends, or u32's largest number.
@group(0) @binding(7) var<storage, read_write> slice_end: array<u32>;

struct Ellipse {
    center: vec2<f32>,
    // In x: q = (dx - slope dy)^2 / inverse_column + row dy^2.
    slope: f32,
    inverse_column: f32,
    row: f32,
    q_max: f32,
    reach_y: f32,
    // dy where the ellipse is farthest right; farthest left at its negative.
    right: f32,
}

fn ellipse(s: Splat) -> Ellipse {
    let c = abs(s.conditional);
    var e: Ellipse;
    e.center = vec2(center_x(s) + s.rest_x, center_y(s) + s.rest_y);
    e.q_max = s.q_max;
    let along = sqrt(s.q_max / s.marginal);
    let across = sqrt(s.q_max * (s.slope * s.slope / s.marginal + 1.0 / c));
    let column = c * s.slope * s.slope + s.marginal;
    if (s.conditional > 0.0) {
        e.slope = s.slope;
        e.inverse_column = 1.0 / c;
        e.row = s.marginal;
        e.reach_y = along;
        e.right = c * s.slope / column * across;
    } else {
        e.slope = c * s.slope / column;
        e.inverse_column = 1.0 / column;
        e.row = c / column * s.marginal;
        e.reach_y = across;
        e.right = s.slope * along;
    }
    return e;
}

// First and last tile of the pixels 0..count whose centres lie in [low, high]; first > last where there is none. The
// slack is a generous bound of the rounding so far; excess tiles are rejected by alpha < 1/255. Rounding of what led
// here, generously: what it lets in is cut at alpha < 1/255.
fn tiles_between(low: f32, high: f32, count: u32) -> vec2<i32> {
    let slack = 0.01 + 2e-6 * max(abs(low), abs(high));
    let last = f32(count) - 1.0;
    let first_pixel = ceil(max(low - slack - 0.5, 0.0));
    let last_pixel = floor(min(high + slack - 0.5, last));
    if (!(first_pixel <= last_pixel)) {
        return vec2(1, 0);
    }
    return vec2<i32>(vec2(first_pixel, last_pixel)) / i32(TILE);
}

// Rows of tiles that the ellipse touches, within the band.
fn rows(e: Ellipse) -> vec2<i32> {
    let rows = tiles_between(e.center.y - e.reach_y, e.center.y + e.reach_y, frame.height);
    let first = i32(frame.first_tile_row);
    return vec2(max(rows.x, first), min(rows.y, first + i32(frame.tile_rows) - 1));
}

// Columns of tiles that the ellipse touches in one row of tiles, within the window.
fn columns(e: Ellipse, row: i32) -> vec2<i32> {
    let top = f32(row * i32(TILE)) + 0.5 - e.center.y;
    let low = clamp(top, -e.reach_y, e.reach_y);
    let high = clamp(top + f32(TILE - 1u), -e.reach_y, e.reach_y);
    let right = clamp(e.right, low, high);
    let left = clamp(-e.right, low, high);
    let half_right = sqrt(max(e.q_max - e.row * right * right, 0.0) * e.inverse_column);
    let half_left = sqrt(max(e.q_max - e.row * left * left, 0.0) * e.inverse_column);
    let from_x = e.center.x + e.slope * left - half_left;
    let to_x = e.center.x + e.slope * right + half_right;
    let columns = tiles_between(from_x, to_x, frame.width);
    let first = i32(frame.first_tile_column);
    return vec2(max(columns.x, first), min(columns.y, first + i32(frame.tile_columns) - 1));
}

@compute @workgroup_size(256)
fn cover(@builtin(global_invocation_id) id: vec3<u32>) {
    let rank = id.x;
    // At least one more than there are splats: the prefix sum stores the total there.
    if (rank >= arrayLength(&offsets)) {
        return;
    }
    var pairs = 0u;
    if (rank >= frame.slice_start && rank < counter[0] && rank - frame.slice_start < frame.slice_splats) {
        let e = ellipse(splats[splat_from_rank[rank]]);
        let r = rows(e);
        for (var row = r.x; row <= r.y; row++) {
            let c = columns(e, row);
            pairs += u32(max(c.y - c.x + 1, 0));
        }
    }
    offsets[rank] = pairs;
}

// Pairs of one splat that one thread writes: drivers that run on the CPU end loops after 65,535 iterations.
const PART: u32 = 32768u;

@compute @workgroup_size(256)
fn emit(@builtin(global_invocation_id) id: vec3<u32>) {
    let rank = id.x;
    if (rank < frame.slice_start || rank >= counter[0] || offsets[rank] > frame.pair_capacity) {
        return;
    }
    if (rank - frame.slice_start >= frame.slice_splats) {
        if (rank - frame.slice_start == frame.slice_splats && id.y == 0u) {
            slice_end[0] = rank;
        }
        return;
    }
    let begin = offsets[rank] + id.y * PART;
    let end = offsets[rank + 1u];
    if (begin >= end || begin > frame.pair_capacity) {
        return;
    }
    let stop = min(min(begin + PART, end), frame.pair_capacity);
    var pair = begin;
    if (end <= frame.pair_capacity) {
        let splat = splat_from_rank[rank];
        let e = ellipse(splats[splat]);
        let r = rows(e);
        // Skip the pairs of the previous parts.
        var skip = i32(id.y * PART);
        for (var row = r.x; row <= r.y && pair < stop; row++) {
            let c = columns(e, row);
            let count = max(c.y - c.x + 1, 0);
            let first = (row - i32(frame.first_tile_row)) * i32(frame.tile_columns) - i32(frame.first_tile_column);
            for (var column = c.x + min(skip, count); column <= c.y && pair < stop; column++) {
                tile_from_pair[pair] = u32(first + column);
                splat_from_pair[pair] = splat;
                pair++;
            }
            skip = max(skip - count, 0);
        }
    } else {
        slice_end[0] = rank;
    }
    // Leave no pair undefined, neither at the end of the slice nor if the two kernels round differently.
    for (; pair < stop; pair++) {
        tile_from_pair[pair] = NOT_DRAWN;
    }
}
