// Range of each tile's pairs, once they are sorted by tile. A slot is a place in the sorted list.

@group(0) @binding(0) var<storage, read> counter: array<u32>;
@group(0) @binding(1) var<storage, read> tile_from_slot: array<u32>;
// [tiles][2]: begin, end; initially zero. Not vectors: threads must not write components of one vector concurrently.
@group(0) @binding(2) var<storage, read_write> ranges: array<u32>;

@compute @workgroup_size(256)
fn find(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = min(counter[0], arrayLength(&tile_from_slot));
    for (var slot = id.x; slot < count; slot += 256u * groups.x) {
        let tile = tile_from_slot[slot];
        if (slot == 0u || tile_from_slot[slot - 1u] != tile) {
            ranges[2u * tile] = slot;
        }
        if (slot + 1u == count || tile_from_slot[slot + 1u] != tile) {
            ranges[2u * tile + 1u] = slot + 1u;
        }
    }
}
