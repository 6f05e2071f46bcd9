// EWA projection and colour of Gaussians, one Gaussian per thread.
//
// With J R R_q S = [a; b] the blurred covariance is [[a.a + e, a.b], [a.b, b.b + e]] and its determinant, by
// Cauchy-Binet, e^2 + e (a.a + b.b) + |a x b|^2: a sum of squares, exact to rounding for needles. Depth and centre are
// computed with twice f32's digits; shape is scaled by a power of two, so that no square leaves f32.

struct Chunk {
    // Range of the Gaussians in these buffers.
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
// [count][11]: mean, quaternion (w, x, y, z), standard deviations, opacity.
@group(0) @binding(2) var<storage, read> shapes: array<f32>;
// [count][sh_stride]
@group(0) @binding(3) var<storage, read> colors: array<f32>;
@group(0) @binding(4) var<storage, read_write> splats: array<Splat>;
// Red, green, blue, depth.
@group(0) @binding(5) var<storage, read_write> tints: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;

const MAX_COORDINATE: f32 = 1e20;

// Returns x, opaquely to the compiler, which may otherwise simplify (a + b) - a to b although they differ in floating
// point.
fn opaque(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ frame.opaque_zero);
}

// a + b with twice the digits: x + y with |y| at most half of x's last digit.
fn two_sum(a: f32, b: f32) -> vec2<f32> {
    let sum = opaque(a + b);
    let rounded_b = opaque(sum - a);
    return vec2(sum, (a - (sum - rounded_b)) + (b - rounded_b));
}

// `two_sum` for |a| >= |b|.
fn ordered_sum(a: f32, b: f32) -> vec2<f32> {
    let sum = opaque(a + b);
    return vec2(sum, b - (sum - a));
}

fn two_product(a: f32, b: f32) -> vec2<f32> {
    // Opaque, so that it is rounded and not fused with the subtraction below.
    let product = opaque(a * b);
    // Halves of twelve bits, whose products are exact.
    let a1 = bitcast<f32>(bitcast<u32>(a) & 0xfffff000u);
    let b1 = bitcast<f32>(bitcast<u32>(b) & 0xfffff000u);
    let a2 = a - a1;
    let b2 = b - b1;
    return vec2(product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2);
}

fn add(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let sum = two_sum(a.x, b.x);
    return ordered_sum(sum.x, sum.y + (a.y + b.y));
}

fn multiply(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let product = two_product(a.x, b.x);
    return ordered_sum(product.x, product.y + (a.x * b.y + a.y * b.x));
}

fn divide(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let first = a.x / b.x;
    let rest = add(a, -multiply(b, vec2(first, 0.0)));
    return ordered_sum(first, rest.x / b.x);
}

fn along(row: u32, d: array<vec2<f32>, 3>) -> vec2<f32> {
    let r = frame.rotation[row];
    let rest = frame.rotation_rest[row];
    let xy = add(multiply(vec2(r.x, rest.x), d[0]), multiply(vec2(r.y, rest.y), d[1]));
    return add(xy, multiply(vec2(r.z, rest.z), d[2]));
}

fn from_center(mean: f32, center: f32, rest: f32) -> vec2<f32> {
    let difference = two_sum(clamp(mean, -MAX_COORDINATE, MAX_COORDINATE), -center);
    return ordered_sum(difference.x, difference.y - rest);
}

@compute @workgroup_size(64)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i >= chunk.count) {
        return;
    }
    let out = chunk.first + i;
    keys[out] = NOT_DRAWN;
    let g = 11u * i;

    let d = array(
        from_center(shapes[g], frame.center.x, frame.center_rest.x),
        from_center(shapes[g + 1u], frame.center.y, frame.center_rest.y),
        from_center(shapes[g + 2u], frame.center.z, frame.center_rest.z),
    );
    let z = along(2u, d);
    let depth = z.x;
    if (!(depth > frame.near && depth < frame.far)) {
        return;
    }
    var x = divide(along(0u, d), z);
    var y = divide(along(1u, d), z);
    // Beyond this a centre is far outside any picture, and products would leave f32.
    if (abs(x.x) > 1e18) {
        x = vec2(clamp(x.x, -1e18, 1e18), 0.0);
    }
    if (abs(y.x) > 1e18) {
        y = vec2(clamp(y.x, -1e18, 1e18), 0.0);
    }
    let u = add(multiply(frame.focal.xy, x), frame.principal.xy);
    let v = add(multiply(frame.focal.zw, y), frame.principal.zw);

    // Rows of J R, its x/z and y/z clamped.
    let xc = clamp(x.x, frame.jacobian_range.x, frame.jacobian_range.y);
    let yc = clamp(y.x, frame.jacobian_range.z, frame.jacobian_range.w);
    let forward = frame.rotation[2].xyz;
    let jx = (frame.focal.x / depth) * (frame.rotation[0].xyz - xc * forward);
    let jy = (frame.focal.z / depth) * (frame.rotation[1].xyz - yc * forward);
    // Columns of R_q S.
    let w = shapes[g + 3u];
    let q = vec3(shapes[g + 4u], shapes[g + 5u], shapes[g + 6u]);
    let two = 2.0 / (w * w + dot(q, q));
    let q2 = two * q;
    let column_x = vec3(1.0 - (q2.y * q.y + q2.z * q.z), q2.x * q.y + w * q2.z, q2.x * q.z - w * q2.y);
    let column_y = vec3(q2.x * q.y - w * q2.z, 1.0 - (q2.x * q.x + q2.z * q.z), q2.y * q.z + w * q2.x);
    let column_z = vec3(q2.x * q.z + w * q2.y, q2.y * q.z - w * q2.x, 1.0 - (q2.x * q.x + q2.y * q.y));
    let scale = vec3(shapes[g + 7u], shapes[g + 8u], shapes[g + 9u]);
    var a = vec3(dot(jx, column_x), dot(jx, column_y), dot(jx, column_z)) * scale;
    var b = vec3(dot(jy, column_x), dot(jy, column_y), dot(jy, column_z)) * scale;

    // Scaled by a power of two near the largest of them.
    let largest_a = max(abs(a.x), max(abs(a.y), abs(a.z)));
    let largest_b = max(abs(b.x), max(abs(b.y), abs(b.z)));
    let largest = max(largest_a, largest_b);
    if (largest > MAX_PIXELS) {
        let shrink = MAX_PIXELS / largest;
        a *= shrink;
        b *= shrink;
    }
    let exponent = bitcast<u32>(clamp(largest, sqrt(frame.blur), MAX_PIXELS)) & 0x7f800000u;
    let unit = bitcast<f32>(exponent);
    let per_unit = bitcast<f32>(0x7f000000u - exponent);
    a *= per_unit;
    b *= per_unit;
    let e = frame.blur * per_unit * per_unit;

    let aa = dot(a, a);
    let bb = dot(b, b);
    let ab = dot(a, b);
    let normal = cross(a, b);
    let before = dot(normal, normal);
    let determinant = e * e + e * (aa + bb) + before;
    let variance_x = aa + e;
    let variance_y = bb + e;
    let pivot_x = variance_x > variance_y;
    let pivot = select(variance_y, variance_x, pivot_x);
    // det >= e pivot: the splat is no narrower than the blur, despite rounding and underflow.
    let conditional = HALF_LOG2_E * min(pivot / determinant * per_unit * per_unit, 1.0 / frame.blur);
    let marginal = HALF_LOG2_E / pivot * per_unit * per_unit;

    var opacity = shapes[g + 10u];
    if (frame.antialiased != 0u) {
        opacity *= sqrt(max(before / determinant, MIN_COMPENSATION * MIN_COMPENSATION));
    }
    if (!(opacity >= ALPHA_THRESHOLD)) {
        return;
    }
    let q_max = log2(255.0 * opacity) + 0.01;
    let reach = sqrt(q_max / HALF_LOG2_E) * unit;
    let reach_x = reach * sqrt(variance_x);
    let reach_y = reach * sqrt(variance_y);

    let whole_u = clamp(round(u.x), -32000.0, 32000.0);
    let whole_v = clamp(round(v.x), -32000.0, 32000.0);
    let rest_u = clamp((u.x - whole_u) + u.y, -MAX_PIXELS, MAX_PIXELS);
    let rest_v = clamp((v.x - whole_v) + v.y, -MAX_PIXELS, MAX_PIXELS);
    // Distance from the picture, with slack for rounding.
    let beyond_u = max(-whole_u - rest_u, whole_u - f32(frame.width) + rest_u);
    let beyond_v = max(-whole_v - rest_v, whole_v - f32(frame.height) + rest_v);
    let slack_u = 0.01 + 1e-6 * (abs(rest_u) + reach_x);
    let slack_v = 0.01 + 1e-6 * (abs(rest_v) + reach_y);
    if (beyond_u > reach_x + slack_u || beyond_v > reach_y + slack_v) {
        return;
    }

    var s: Splat;
    s.center = (u32(i32(whole_u)) & 0xffffu) | (u32(i32(whole_v)) << 16u);
    s.rest_x = rest_u;
    s.rest_y = rest_v;
    s.slope = ab / pivot;
    s.conditional = select(conditional, -conditional, pivot_x);
    s.marginal = marginal;
    s.opacity = opacity;
    s.q_max = q_max;
    splats[out] = s;
    tints[out] = vec4(color(i, vec3(d[0].x, d[1].x, d[2].x)), depth);
    keys[out] = max(bitcast<u32>(depth), frame.first_key) - frame.first_key;
}

fn coefficient(first: u32, k: u32) -> vec3<f32> {
    let at = first + 3u * k;
    let c = vec3(colors[at], colors[at + 1u], colors[at + 2u]);
    return clamp(c, vec3(-MAX_COLOR), vec3(MAX_COLOR));
}

// max(0, 0.5 + sum_k sh_k Y_k(d)), in 3DGS's order and signs.
fn color(i: u32, d: vec3<f32>) -> vec3<f32> {
    let first = i * frame.sh_stride;
    // Divide by the largest component first: its square may leave f32.
    let largest = max(max(abs(d.x), abs(d.y)), max(abs(d.z), 1e-30));
    let scaled = d / largest;
    let n = scaled / length(scaled);
    let x = n.x;
    let y = n.y;
    let z = n.z;
    var sum = 0.2820948 * coefficient(first, 0u);
    if (frame.sh_coefficients > 1u) {
        let c = 0.48860252;
        sum += (-c * y) * coefficient(first, 1u);
        sum += (c * z) * coefficient(first, 2u);
        sum += (-c * x) * coefficient(first, 3u);
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    if (frame.sh_coefficients > 4u) {
        sum += (1.0925485 * x * y) * coefficient(first, 4u);
        sum += (-1.0925485 * y * z) * coefficient(first, 5u);
        sum += (0.31539157 * (2.0 * zz - xx - yy)) * coefficient(first, 6u);
        sum += (-1.0925485 * x * z) * coefficient(first, 7u);
        sum += (0.5462742 * (xx - yy)) * coefficient(first, 8u);
    }
    if (frame.sh_coefficients > 9u) {
        sum += (-0.5900436 * y * (3.0 * xx - yy)) * coefficient(first, 9u);
        sum += (2.8906114 * x * y * z) * coefficient(first, 10u);
        sum += (-0.4570458 * y * (4.0 * zz - xx - yy)) * coefficient(first, 11u);
        sum += (0.37317634 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy)) * coefficient(first, 12u);
        sum += (-0.4570458 * x * (4.0 * zz - xx - yy)) * coefficient(first, 13u);
        sum += (1.4453057 * z * (xx - yy)) * coefficient(first, 14u);
        sum += (-0.5900436 * x * (xx - 3.0 * yy)) * coefficient(first, 15u);
    }
    return clamp(vec3(0.5) + sum, vec3(0.0), vec3(MAX_COLOR));
}
