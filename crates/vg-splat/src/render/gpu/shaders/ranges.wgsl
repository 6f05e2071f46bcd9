// Where each tile's pairs begin and end, once they are sorted by tile.

@group(0) @binding(0) var<storage, read> counter: array<u32>;
@group(0) @binding(1) var<storage, read> pair_tiles: array<u32>;
// [tiles][2]: begin, end; zero before. Not vectors: threads may not write to one vector's components at once.
@group(0) @binding(2) var<storage, read_write> ranges: array<u32>;

@compute @workgroup_size(256)
fn find(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = min(counter[0], arrayLength(&pair_tiles));
    for (var i = id.x; i < count; i += 256u * groups.x) {
        let tile = pair_tiles[i];
        if (i == 0u || pair_tiles[i - 1u] != tile) {
            ranges[2u * tile] = i;
        }
        if (i + 1u == count || pair_tiles[i + 1u] != tile) {
            ranges[2u * tile + 1u] = i + 1u;
        }
    }
}
