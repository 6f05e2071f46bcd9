// The layers of a tile and their alpha at a pixel, for forward and backward blending.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;
// Pair at each slot of the list sorted by tile, nearest first.
@group(0) @binding(2) var<storage, read> pair_from_slot: array<u32>;
@group(0) @binding(3) var<storage, read> splat_from_pair: array<u32>;
@group(0) @binding(4) var<storage, read> splats: array<Splat>;
@group(0) @binding(5) var<storage, read> tints: array<vec4<f32>>;

const PIXELS: u32 = TILE * TILE;

// Layers that all pixels of the tile process.
var<workgroup> batch: array<Splat, PIXELS>;
var<workgroup> batch_tints: array<vec4<f32>, PIXELS>;
var<workgroup> any_live: atomic<u32>;
var<workgroup> shared_number: u32;

// Whether a pixel of the tile is unfinished. Its barriers also ensure that no thread still reads the batch.
fn is_any_pixel_live(live: bool, lane: u32) -> bool {
    if (lane == 0u) {
        atomicStore(&any_live, 0u);
    }
    workgroupBarrier();
    if (live) {
        atomicStore(&any_live, 1u);
    }
    workgroupBarrier();
    if (lane == 0u) {
        shared_number = atomicLoad(&any_live);
    }
    return workgroupUniformLoad(&shared_number) != 0u;
}

// Loads `count` layers from slot `begin` on into the batch.
fn load_batch(begin: u32, count: u32, lane: u32) {
    if (lane < count) {
        let splat = splat_from_pair[pair_from_slot[begin + lane]];
        batch[lane] = splats[splat];
        batch_tints[lane] = tints[splat];
    }
    workgroupBarrier();
}

// 2^x for x <= 0: 2^round(x) times a polynomial in the rest, accurate to 2 ulp. The error of the built-in grows with x.
fn exp2_accurate(x: f32) -> f32 {
    let y = max(x, -100.0);
    let n = round(y);
    let f = y - n;
    var p = 1.5453163e-4;
    p = p * f + 1.3390863e-3;
    p = p * f + 9.618083e-3;
    p = p * f + 5.550357e-2;
    p = p * f + 0.2402265;
    p = p * f + 0.6931472;
    p = p * f + 1.0;
    return p * bitcast<f32>(u32(i32(n) + 127) << 23u);
}

// Offset from a splat's centre to a pixel's: off the pivot's axis, sheared so that the exponent has no mixed term, and
// along it.
fn sheared_offset(s: Splat, pixel: vec2<f32>) -> vec2<f32> {
    let dx = (pixel.x - center_x(s)) - s.rest_x;
    let dy = (pixel.y - center_y(s)) - s.rest_y;
    let is_pivot_x = s.conditional < 0.0;
    let along = select(dy, dx, is_pivot_x);
    return vec2(select(dx, dy, is_pivot_x) - s.slope * along, along);
}

fn splat_alpha(s: Splat, offset: vec2<f32>) -> f32 {
    let q = abs(s.conditional) * (offset.x * offset.x) + s.marginal * (offset.y * offset.y);
    return min(s.opacity * exp2_accurate(-q), frame.max_alpha);
}
