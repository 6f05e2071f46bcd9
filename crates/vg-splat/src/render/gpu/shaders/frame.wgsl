// Parameters of all stages, shared arithmetic, and the projected Gaussian.

struct Frame {
    // Rows of camera_from_vehicle's rotation; `_rest` fields hold the rounding errors in f32.
    rotation: array<vec4<f32>, 3>,
    rotation_rest: array<vec4<f32>, 3>,
    // The camera's centre, vehicle frame, metres.
    center: vec4<f32>,
    center_rest: vec4<f32>,
    // fx, its rest, fy, its rest; then cx, its rest, cy, its rest.
    focal: vec4<f32>,
    principal: vec4<f32>,
    // Range of x/z, then of y/z, in which the Jacobian is taken.
    jacobian_range: vec4<f32>,
    // Colour and 1, or zeros for a transparent background.
    background: vec4<f32>,
    // Size of the picture, pixels.
    width: u32,
    height: u32,
    near: f32,
    far: f32,
    blur: f32,
    max_alpha: f32,
    // Number of Gaussians.
    count: u32,
    // Floats of colour per Gaussian, and the number of coefficients used per channel.
    sh_stride: u32,
    sh_coefficients: u32,
    antialiased: u32,
    expected_depth: u32,
    // Always 0, which a compiler cannot deduce: see `opaque` and `is_cut_short`.
    opaque_zero: u32,
    // The current band of the picture, or window of a band, in tiles.
    tile_columns: u32,
    first_tile_row: u32,
    tile_rows: u32,
    // Depth rank at which the slice begins, and the maximum numbers of its splats and (tile, splat) pairs.
    slice_start: u32,
    slice_splats: u32,
    pair_capacity: u32,
    // Whether the slice is the first of the band, and the last; 2: the last, and the picture is written as bytes.
    is_first: u32,
    is_last: u32,
    // Bits of the smallest depth that can occur.
    first_key: u32,
    // First column of a window narrower than the band.
    first_tile_column: u32,
    // Backward pass: the row of pixels at which the band begins, and the range of pairs whose gradients are held.
    band_row: u32,
    first_pair: u32,
    held_pairs: u32,
}

// 32 bytes. The exponent of a splat is, in base 2 with (dx, dy) from its centre to a pixel's centre,
//   pivot Y (conditional > 0):  q = conditional (dx - slope dy)^2 + marginal dy^2
//   pivot X (conditional < 0):  q = |conditional| (dy - slope dx)^2 + marginal dx^2
// Cholesky's form of the blurred covariance with the larger diagonal as pivot.
struct Splat {
    // Centre in pixels, rounded and clamped to 16 bits each ...
    center: u32,
    // ... and the remainder.
    rest_x: f32,
    rest_y: f32,
    slope: f32,
    conditional: f32,
    marginal: f32,
    opacity: f32,
    // At least log2(255 opacity): where q exceeds this, alpha is below 1/255.
    q_max: f32,
}

const TILE: u32 = 8u;
const NOT_DRAWN: u32 = 0xffffffffu;
const ALPHA_THRESHOLD: f32 = 1.0 / 255.0;
const TRANSMITTANCE_THRESHOLD: f32 = 1e-4;
// Upper clamp of colours, so that sums stay in f32.
const MAX_COLOR: f32 = 1e30;
const MIN_COMPENSATION: f32 = 0.005;
const HALF_LOG2_E: f32 = 0.72134752;
// Upper clamp of lengths in pixels, so that their squares stay in f32.
const MAX_PIXELS: f32 = 1e15;

fn center_x(s: Splat) -> f32 {
    return f32(bitcast<i32>(s.center << 16u) >> 16u);
}

fn center_y(s: Splat) -> f32 {
    return f32(bitcast<i32>(s.center) >> 16u);
}

// Whether the driver ended a loop early. Drivers that run on the CPU (Mesa's llvmpipe) allow a thread 65,535 iterations
// of all its loops together and then silently leave them. Called at the end, this detects it; `opaque_zero` is 0, so
// that no compiler can remove the loop.
fn is_cut_short(opaque_zero: u32) -> bool {
    var turns = 0u;
    for (var i = 0u; i < 4u + opaque_zero; i++) {
        turns++;
    }
    return turns != 4u;
}
