// Prefix sums of any length: each block of 2048 by itself, its total to the level above, and down again. Sums saturate
// at the largest u32.

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
// One per block: its total on the way up, the sum before it on the way down.
@group(0) @binding(1) var<storage, read_write> totals: array<u32>;

const THREADS: u32 = 256u;
const EACH: u32 = 8u;

var<workgroup> partial: array<u32, THREADS>;

fn saturating(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

@compute @workgroup_size(THREADS)
fn scan(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let len = arrayLength(&values);
    let first = (group.x * THREADS + lane) * EACH;
    var own: array<u32, EACH>;
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        own[k] = sum;
        if (first + k < len) {
            sum = saturating(sum, values[first + k]);
        }
    }
    partial[lane] = sum;
    workgroupBarrier();
    for (var step = 1u; step < THREADS; step *= 2u) {
        var before = 0u;
        if (lane >= step) {
            before = partial[lane - step];
        }
        workgroupBarrier();
        partial[lane] = saturating(partial[lane], before);
        workgroupBarrier();
    }
    var before = 0u;
    if (lane > 0u) {
        before = partial[lane - 1u];
    }
    for (var k = 0u; k < EACH; k++) {
        if (first + k < len) {
            values[first + k] = saturating(before, own[k]);
        }
    }
    if (lane == THREADS - 1u) {
        totals[group.x] = partial[lane];
    }
}

@compute @workgroup_size(THREADS)
fn add(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let len = arrayLength(&values);
    let before = totals[group.x];
    let first = (group.x * THREADS + lane) * EACH;
    for (var k = 0u; k < EACH; k++) {
        if (first + k < len) {
            values[first + k] = saturating(values[first + k], before);
        }
    }
}
