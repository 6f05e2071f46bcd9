// One pass of a stable radix sort by four bits: count digits per block of 1024, sum over (digit, block), scatter. An
// entry's place depends neither on floating point nor on the order of threads.

struct Pass {
    // Position of the digit in the key, bits.
    shift: u32,
    // In the first pass values are the entries' own indices, and entries with the key NOT_DRAWN are dropped.
    is_first: u32,
    // Number of blocks launched.
    blocks: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> sort: Pass;
// Number of entries.
@group(0) @binding(1) var<storage, read> counter: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
// [16][blocks]: counts, then starts.
@group(0) @binding(3) var<storage, read_write> histogram: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

const THREADS: u32 = 256u;
const EACH: u32 = 4u;
const BLOCK: u32 = 1024u;

var<workgroup> counts: array<atomic<u32>, 16>;

fn is_entry(i: u32) -> bool {
    // The key is read only where there is one.
    if (i >= min(counter[0], arrayLength(&keys))) {
        return false;
    }
    return sort.is_first == 0u || keys[i] != NOT_DRAWN;
}

@compute @workgroup_size(THREADS)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if (lane < 16u) {
        atomicStore(&counts[lane], 0u);
    }
    workgroupBarrier();
    for (var k = 0u; k < EACH; k++) {
        // Neighbouring threads read neighbouring keys.
        let i = group.x * BLOCK + k * THREADS + lane;
        if (is_entry(i)) {
            atomicAdd(&counts[(keys[i] >> sort.shift) & 15u], 1u);
        }
    }
    workgroupBarrier();
    if (lane < 16u) {
        histogram[lane * sort.blocks + group.x] = atomicLoad(&counts[lane]);
    }
}

// Word w of thread t, at w * THREADS + t: counts of digit w in the low half, of digit w + 8 in the high half.
var<workgroup> ranks: array<u32, 2048>;
var<workgroup> partial: array<u32, THREADS>;
// Destination of the block's entries of each digit.
var<workgroup> starts: array<u32, 16>;

@compute @workgroup_size(THREADS)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    for (var w = 0u; w < 8u; w++) {
        ranks[w * THREADS + lane] = 0u;
    }
    // Each thread counts its four consecutive entries by digit.
    var key: array<u32, EACH>;
    var rank: array<u32, EACH>;
    let first = group.x * BLOCK + lane * EACH;
    for (var k = 0u; k < EACH; k++) {
        key[k] = 0u;
        rank[k] = NOT_DRAWN;
        if (is_entry(first + k)) {
            key[k] = keys[first + k];
            let digit = (key[k] >> sort.shift) & 15u;
            let word = (digit & 7u) * THREADS + lane;
            let shift = (digit >> 3u) * 16u;
            rank[k] = (ranks[word] >> shift) & 0xffffu;
            ranks[word] += 1u << shift;
        }
    }
    workgroupBarrier();

    // Running sums over all words, digit after digit.
    var sum = 0u;
    for (var k = 0u; k < 8u; k++) {
        let word = lane * 8u + k;
        let own = ranks[word];
        ranks[word] = sum;
        sum += own;
    }
    partial[lane] = sum;
    workgroupBarrier();
    for (var step = 1u; step < THREADS; step *= 2u) {
        var before = 0u;
        if (lane >= step) {
            before = partial[lane - step];
        }
        workgroupBarrier();
        partial[lane] += before;
        workgroupBarrier();
    }
    var before = 0u;
    if (lane > 0u) {
        before = partial[lane - 1u];
    }
    // The digits of the low halves precede those of the high halves.
    before += (partial[THREADS - 1u] & 0xffffu) << 16u;
    for (var k = 0u; k < 8u; k++) {
        ranks[lane * 8u + k] += before;
    }
    workgroupBarrier();
    if (lane < 16u) {
        let in_block = (ranks[(lane & 7u) * THREADS] >> ((lane >> 3u) * 16u)) & 0xffffu;
        starts[lane] = histogram[lane * sort.blocks + group.x] - in_block;
    }
    workgroupBarrier();

    for (var k = 0u; k < EACH; k++) {
        if (rank[k] != NOT_DRAWN) {
            let digit = (key[k] >> sort.shift) & 15u;
            let in_block = (ranks[(digit & 7u) * THREADS + lane] >> ((digit >> 3u) * 16u)) & 0xffffu;
            let to = starts[digit] + in_block + rank[k];
            keys_out[to] = key[k];
            if (sort.is_first != 0u) {
                values_out[to] = first + k;
            } else {
                values_out[to] = values[first + k];
            }
        }
    }
}
