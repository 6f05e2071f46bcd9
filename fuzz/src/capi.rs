//! Calls of the C functions with some changes: numbers, sizes, pointers, whole pictures. Memory is always as large as the
//! call promises, so that any read or write elsewhere is a bug of the library.
//!
//! The valid calls, and the checks after each, are those of the table in `tests/abi/arguments.rs`.

pub use calls::World;
use calls::{CALLS, CANARY, Call, Done, Lent, Made, Memory, Target, Value, text};
use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;
use std::ptr::null_mut;
use vg_face::capi::*;

#[path = "../../tests/abi/arguments/calls.rs"]
mod calls;

/// No guard bytes: the address sanitizer guards to the byte.
pub(crate) const GUARD: usize = 0;

/// Largest memory allocated for a picture.
const MAX_BYTES: usize = 1 << 24;

/// The source of decisions.
pub trait Source {
    fn byte(&mut self) -> u8;

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn bits(&mut self) -> u64 {
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T
    where
        Self: Sized,
    {
        of[self.below(of.len())]
    }
}

/// The handles and inputs of calls. The sample is in the repository; saved files go to `scratch`.
pub fn world(scratch: &Path) -> World {
    std::fs::create_dir_all(scratch).expect("a folder to save in");
    World::new(&vg_testing::root().join("tests/data/sedan"), scratch)
}

/// Makes up to three calls, each with the results of the earlier ones.
///
/// # Panics
/// If a promise of the header is broken.
pub fn execute<S: Source>(world: &World, source: &mut S) -> Vec<(&'static str, vg_status)> {
    let mut made: Vec<Done> = Vec::new();
    let mut log = Vec::new();
    for _ in 0..=source.below(3) {
        // The largest functions are called more often.
        let large: [fn(&World) -> Call; 5] = [
            calls::reconstruct,
            calls::render,
            calls::render_through_a_lens,
            calls::render_backward_with_a_picture,
            calls::render_backward_through_a_lens,
        ];
        let make = if source.one_in(3) { source.pick(&large) } else { source.pick(&CALLS) };
        let mut call = make(world);
        for _ in 0..source.below(7) {
            change(world, &mut call, &made, source);
        }
        match call.function {
            "vg_reconstruct" | "vg_refine" => back_views(&mut call),
            "vg_render" => back_target(&mut call),
            "vg_render_backward" => back_gradients(&mut call),
            "vg_gaussians_from_arrays" => back_arrays(&mut call),
            _ => {}
        }
        STOP_IN.set(source.below(64));
        let done = call.run(!source.one_in(8));
        log.push((call.function, done.status));
        read_results(&done);
        made.push(done);
    }
    log
}

/// Reads the results, as a caller would next.
fn read_results(done: &Done) {
    let report = done.handle("out_report");
    if report != 0 {
        unsafe {
            let mut figures: vg_report_figures = std::mem::zeroed();
            vg_report_figures_init(&raw mut figures, size_of::<vg_report_figures>());
            assert_eq!(vg_report_get_figures(report as _, &raw mut figures, null_mut()), vg_status::Ok);
            assert!(figures.extent_low.iter().chain(&figures.extent_high).all(|v| v.is_finite()));
            assert!(figures.box_size.iter().all(|v| v.is_finite()) && !figures.input_psnr_db.is_nan());
            let n = vg_report_point_count(report as _) * 3;
            if n > 0 {
                let positions = std::slice::from_raw_parts(vg_report_point_positions(report as _), n);
                assert!(positions.iter().all(|v| v.is_finite()), "points are finite");
                let colors = std::slice::from_raw_parts(vg_report_point_colors(report as _), n);
                std::hint::black_box(colors.iter().map(|&c| u64::from(c)).sum::<u64>());
            }
            assert!(CStr::from_ptr(vg_report_json(report as _)).to_bytes().starts_with(b"{"));
        }
    }
}

const NUMBERS: [i32; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 77, 48, 36, -1, i32::MIN, i32::MAX, 8193];

const FLOATS: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    0.5,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MIN_POSITIVE,
    1e-45,
    1e-20,
    1e-4,
    1e10,
    1e19,
    1e30,
    f32::MAX,
];

fn any_double<S: Source>(source: &mut S, now: f64) -> f64 {
    match source.below(4) {
        0 => f64::from(source.pick(&FLOATS)),
        1 => now * (1.0 + f64::from(source.byte()) * 1e-5),
        2 => now + f64::from(source.byte().cast_signed()) * 0.05,
        _ => {
            let sign = source.pick(&[1.0, -1.0]);
            sign * 10f64.powi(i32::from(source.byte().cast_signed())) * f64::from(source.byte().max(1))
        }
    }
}

/// Changes one thing.
fn change<S: Source>(world: &World, call: &mut Call, made: &[Done], source: &mut S) {
    if source.one_in(3) && whole(call, world, source) {
        return;
    }
    let i = source.below(call.arguments.len());
    let (name, tries) = (call.arguments[i].name, call.arguments[i].tries.clone());
    if source.one_in(24) && !matches!(call.arguments[i].value, Value::Number(_)) {
        call.arguments[i].value = Value::Null;
        return;
    }
    match &mut call.arguments[i].value {
        Value::Number(value) => {
            let any = bits_of(source.pick(&NUMBERS));
            let now = *value;
            *value = match name {
                // Counts of memory with a fixed size.
                "count" | "point_count" | "sparse_count" | "scan_count" | "index_count" | "keep_count" => {
                    match source.below(3) {
                        0 if !tries.is_empty() => tries[source.below(tries.len())].0,
                        _ => source.below(now as usize + 1) as u64,
                    }
                }
                "size" if call.function.contains("ply_memory") => source.below(now as usize + 1) as u64,
                "view_count" | "param_count" | "distortion_count" | "size" => match source.below(3) {
                    0 if !tries.is_empty() => tries[source.below(tries.len())].0,
                    _ if name == "view_count" => source.below(5) as u64,
                    _ if name == "size" => source.bits() % 4200,
                    _ => source.below(17) as u64,
                },
                _ => any,
            };
            back_count(call, i);
        }
        Value::Doubles(values) => {
            if !values.is_empty() {
                let k = source.below(values.len());
                values[k] = any_double(source, values[k]);
            }
        }
        Value::Text(path) => {
            let choices: [CString; 6] = [
                text(world.scratch.join("few.ply")),
                text(world.scratch.join("saved.ply")),
                text(&world.scratch),
                CString::default(),
                CString::new(&b"/nowhere/\xff/at all\n.ply"[..]).expect("no NUL"),
                text(&world.sample),
            ];
            let saves = call.function.contains("save");
            *path = choices[1 + source.below(if saves { 4 } else { 5 })].clone();
        }
        Value::Handle(handle) if call.function.contains("gaussians") || name == "gaussians" => {
            let mut choices = vec![world.gaussians, world.few];
            let gaussians = made.iter().flat_map(|done| &done.handles).filter(|h| h.1 == Made::Gaussians);
            choices.extend(gaussians.map(|h| h.2));
            *handle = choices[choices.len() - 1 - source.below(choices.len())];
        }
        Value::Struct(lent) | Value::OutStruct(lent) => {
            let is_init = call.function.ends_with("_init");
            match source.below(16) {
                _ if is_init => lent.shift = source.below(9),
                0 => lent.shift = source.below(9),
                1 => {
                    let size = source.pick(&[0, 8, lent.stride - 1, lent.stride + 8, lent.stride + 64, 4096]);
                    // Cameras are written completely, whatever their content.
                    if name != "out" || lent.of != "vg_camera" {
                        lent.resize(size, source.pick(&[0, 0, 0, 1]));
                    }
                }
                2 => {
                    let element = source.below(lent.count);
                    lent.claim(element, source.pick(&[0, 7, 4097, usize::MAX / 2, usize::MAX]));
                }
                _ => field(world, call, i, source),
            }
        }
        Value::Null | Value::Handle(_) | Value::OutHandle(_) | Value::OutDoubles(_) => {}
    }
}

fn bits_of(value: i32) -> u64 {
    u64::from(value.cast_unsigned())
}

/// Makes the memory that a count promises.
fn back_count(call: &mut Call, i: usize) {
    let Value::Number(count) = call.arguments[i].value else { return };
    match call.arguments[i].name {
        "param_count" | "distortion_count" if count <= 16 => {
            if let Value::Doubles(values) = &mut call.arguments[i - 1].value {
                values.resize(count as usize, 0.0);
            }
        }
        "size" => {
            if let Value::OutStruct(lent) = &mut call.arguments[0].value {
                lent.bytes = vec![CANARY; (count as usize).clamp(16, 4200)];
            }
        }
        _ => {}
    }
}

/// Changes a field of a struct argument.
fn field<S: Source>(world: &World, call: &mut Call, i: usize, source: &mut S) {
    let (Value::Struct(lent) | Value::OutStruct(lent)) = &mut call.arguments[i].value else { return };
    if lent.stride < lent.fields.iter().map(|f| f.size * f.count).sum() {
        return;
    }
    let (element, f) = (source.below(lent.count), source.below(lent.fields.len()));
    let field = lent.fields[f].clone();
    let k = source.below(field.count);
    let put = |lent: &mut Lent, bits: u64| lent.put_in(element, &field.name, k, bits);
    match field.name.as_str() {
        // No model exists, and a library at a path must be loadable. A loss callback would have nothing to read.
        "struct_size" | "prior_model" | "head_model" | "runtime" | "loss" | "loss_user" => {}
        "context" => put(lent, source.pick(&[0, world.context as u64])),
        "progress" => put(lent, source.pick(&[0, on_progress as *const () as u64])),
        "log" => put(lent, source.pick(&[0, on_log as *const () as u64])),
        "threads" if lent.of == "vg_context_options" => {
            put(lent, source.pick(&[0, 1, 2, 3, 8, 1025, u64::from(u32::MAX)]));
        }
        "name" => {
            let mut bytes: Vec<u8> = (0..source.below(12)).map(|_| source.byte().max(1)).collect();
            bytes.push(0);
            let mut memory = Memory::new(&bytes, 0);
            put(lent, memory.pointer() as u64);
            call.inputs.push(memory);
        }
        // Pictures get their memory after all other changes; arrays and names may become NULL.
        "image.data" | "mask.data" | "depth.data" | "color" | "depth" | "positions" | "scales"
        | "rotations" | "opacities" | "sh" | "names" | "vehicle_from_world" | "alpha" | "background"
        | "pose" | "view_matrix"
            if field.size == 8 =>
        {
            if source.one_in(3) {
                put(lent, 0);
            }
        }
        "cloud" => {
            let points: Vec<f32> = (0..9).map(|_| source.pick(&FLOATS)).collect();
            let mut memory = Memory::from_values(&points, 0);
            put(lent, memory.pointer() as u64);
            call.inputs.push(memory);
            let Value::Struct(lent) = &mut call.arguments[i].value else { return };
            lent.put_in(element, "cloud_count", 0, source.below(4) as u64);
        }
        // The count of a cloud that may be NULL.
        "cloud_count" => put(lent, source.pick(&[0, 10_000_001, 1 << 60, u64::MAX])),
        "name_count" => put(lent, source.pick(&[0, 1, 2, 4097, u64::MAX])),
        "count" if lent.of == "vg_gaussian_arrays" => {
            put(lent, source.pick(&[0, 1, 2, 3, 1 << 31, u64::MAX]))
        }
        "image.row_stride" | "mask.row_stride" | "depth.row_stride" | "color_row_stride"
        | "depth_row_stride" | "alpha_row_stride" => {
            let row = source.pick(&[
                0,
                1,
                35,
                48,
                144,
                191,
                192,
                193,
                777,
                1 << 20,
                1 << 40,
                u64::MAX / 2,
                u64::MAX,
            ]);
            put(lent, row);
        }
        _ if !field.tries.is_empty() && source.one_in(3) => {
            put(lent, field.tries[source.below(field.tries.len())].0)
        }
        _ if field.size == 4 => {
            let float = u64::from(source.pick(&FLOATS).to_bits());
            put(lent, if source.one_in(2) { float } else { bits_of(source.pick(&NUMBERS)) });
        }
        _ => {
            let now = f64::from_bits(lent.get(element, &field.name, k));
            put(lent, any_double(source, now).to_bits());
        }
    }
}

/// Makes changes of several fields at once: other sizes, other poses, other pixels. Returns false if there are none.
fn whole<S: Source>(call: &mut Call, world: &World, source: &mut S) -> bool {
    let (lent, camera) = match call.function {
        "vg_reconstruct" => ("views", "camera."),
        "vg_render" | "vg_render_backward" | "vg_camera_project" | "vg_camera_scale" | "vg_camera_crop" => {
            ("camera", "")
        }
        "vg_gaussians_from_arrays" => return spoil(call, source),
        _ => return false,
    };
    let at = call.position(lent);
    let Value::Struct(argument) = &mut call.arguments[at].value else { return false };
    if argument.stride < 280 {
        return false;
    }
    let element = source.below(argument.count);
    let name = |field: &str| format!("{camera}{field}");
    match source.below(5) {
        0 => {
            let sides = [1, 2, 3, 7, 48, 65, 200];
            let (width, height) = (source.pick(&sides), source.pick(&sides));
            argument.put_in(element, &name("width"), 0, width);
            argument.put_in(element, &name("height"), 0, height);
            let other = match call.function {
                "vg_render" => "target",
                "vg_render_backward" => "gradient",
                _ => lent,
            };
            let parts: &[&str] = match call.function {
                "vg_reconstruct" => &["image.", "mask.", "depth."],
                "vg_render" | "vg_render_backward" => &[""],
                _ => &[],
            };
            let at = call.position(other).min(call.arguments.len());
            let Value::Struct(argument) = &mut call.arguments[at].value else { return true };
            if argument.stride < 56 {
                return true;
            }
            for part in parts {
                argument.put_in(element.min(argument.count - 1), &format!("{part}width"), 0, width);
                argument.put_in(element.min(argument.count - 1), &format!("{part}height"), 0, height);
            }
        }
        1 => {
            // The position of another view, or an arbitrary one.
            let other = &world.photographs[source.below(world.photographs.len())].camera.vehicle_from_camera;
            let turned = [0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.5];
            let pose = if source.one_in(2) { other } else { &turned };
            for (k, value) in pose.iter().enumerate() {
                argument.put_in(element, &name("vehicle_from_camera"), k, value.to_bits());
            }
        }
        2 => {
            let k = source.pick(&[3, 7, 11]);
            let far = [1e-3, 0.1, 1.0, 10.0, 1e2, 1e3, 1e6, 1e9, 1e12, 1.1e12, 1e20, 1e39, 1e155, 1e300];
            let metres: f64 = source.pick(&[1.0, -1.0]) * source.pick(&far);
            argument.put_in(element, &name("vehicle_from_camera"), k, metres.to_bits());
        }
        3 => {
            let model = source.below(7);
            argument.put_in(element, &name("model"), 0, model as u64);
            let size = source.pick(&[1e-3, 0.1, 1.0, 30.0]);
            for k in 0..16 {
                let lens = size * (f64::from(source.byte()) / 128.0 - 1.0);
                let used = [3, 4, 4, 5, 8, 8, 12][model];
                let value = if k < 4 && k < used { 20.0 + f64::from(source.byte()) } else { lens };
                argument.put_in(element, &name("params"), k, if k < used { value.to_bits() } else { 0 });
            }
        }
        _ => return spoil(call, source),
    }
    true
}

/// Changes numbers or pixels in memory that the call reads.
fn spoil<S: Source>(call: &mut Call, source: &mut S) -> bool {
    if call.inputs.is_empty() || !matches!(call.function, "vg_reconstruct" | "vg_gaussians_from_arrays") {
        return false;
    }
    let which = source.below(call.inputs.len());
    let memory = &mut call.inputs[which];
    if call.function == "vg_reconstruct" && memory.content().len() < 48 * 36 {
        return false;
    }
    let len = memory.content().len();
    let (count, start) = match source.below(4) {
        0 => (len / 4, 0),
        1 => (1 + source.below(64), (source.bits() as usize % len) & !3),
        _ => (1, (source.bits() as usize % len) & !3),
    };
    let value = source.pick(&FLOATS);
    for k in 0..count {
        let at = start + 4 * k;
        if at + 4 <= len {
            memory.poke(at, &value.to_ne_bytes());
        }
    }
    true
}

/// Bytes of a picture from its first to its last pixel; `None` if the library must not read it.
fn extent(width: u64, height: u64, stride: u64, format: u64) -> Option<(usize, usize, usize)> {
    let pixel = match format {
        1 | 2 => 3,
        3 | 4 | 7 => 4,
        5 => 1,
        6 => 16,
        _ => return None,
    };
    pixel_extent(width, height, stride, pixel)
}

/// Bytes of a picture whose pixels have `pixel` bytes, from its first to its last pixel, as in [`extent`].
fn pixel_extent(width: u64, height: u64, stride: u64, pixel: u64) -> Option<(usize, usize, usize)> {
    let side = 1..=8192;
    if !side.contains(&width) || !side.contains(&height) {
        return None;
    }
    let row = width * pixel;
    let stride = if stride == 0 { row } else { stride };
    let len = (height - 1).checked_mul(stride)?.checked_add(row)?;
    (stride >= row && len <= isize::MAX as u64).then_some((len as usize, row as usize, stride as usize))
}

/// Allocates the memory of every picture of every view.
fn back_views(call: &mut Call) {
    let at = call.position("views");
    let Value::Struct(lent) = &mut call.arguments[at].value else { return };
    if lent.stride < 392 {
        return;
    }
    for element in 0..lent.count {
        for part in ["image", "mask", "depth"] {
            let field = |name: &str| format!("{part}.{name}");
            let number = |lent: &Lent, name: &str| lent.get(element, &field(name), 0);
            let data = number(lent, "data") as usize;
            if data == 0 {
                continue;
            }
            let [width, height, stride, format] =
                ["width", "height", "row_stride", "format"].map(|name| number(lent, name));
            let Some((len, ..)) = extent(width, height, stride, format) else { continue };
            let old = call.inputs.iter_mut().position(|m| m.pointer() == data).expect("a picture");
            if call.inputs[old].content().len() == len {
                continue;
            }
            if len > MAX_BYTES {
                lent.put_in(element, &field("height"), 0, 0);
                continue;
            }
            let content: Vec<u8> = call.inputs[old].content().iter().copied().cycle().take(len).collect();
            let mut memory = Memory::new(&content, element);
            lent.put_in(element, &field("data"), 0, memory.pointer() as u64);
            call.inputs.push(memory);
        }
    }
}

/// Allocates the memory of the targets of a picture.
fn back_target(call: &mut Call) {
    let at = call.position("target");
    let Value::Struct(lent) = &mut call.arguments[at].value else { return };
    if lent.stride < 72 {
        return;
    }
    // Backward calls have eight arrays first.
    call.targets.truncate(if call.function == "vg_render" { 0 } else { 8 });
    for (part, shift) in [("color", 1), ("depth", 2), ("alpha", 3)] {
        if lent.get(0, part, 0) == 0 {
            continue;
        }
        let format = if part == "color" { lent.get(0, "color_format", 0) } else { 7 };
        let [width, height, stride] =
            ["width", "height", &format!("{part}_row_stride")].map(|name| lent.get(0, name, 0));
        let Some((len, row, stride)) = extent(width, height, stride, format) else { continue };
        if len > MAX_BYTES {
            lent.put("height", 0, 0);
            continue;
        }
        let memory = Memory::new(&vec![CANARY; len], shift);
        let mut target = Target { memory, row, stride, is_float: matches!(format, 6 | 7) };
        lent.put(part, 0, target.memory.pointer() as u64);
        call.targets.push(target);
    }
}

/// Allocates the memory of a gradient's planes, and of the picture.
fn back_gradients(call: &mut Call) {
    back_target(call);
    let at = call.position("gradient");
    let Value::Struct(lent) = &mut call.arguments[at].value else { return };
    if lent.stride < 88 {
        return;
    }
    for (part, pixel) in [("color", 12), ("alpha", 4), ("depth", 4)] {
        if lent.get(0, part, 0) == 0 {
            continue;
        }
        let [width, height, stride] =
            ["width", "height", &format!("{part}_row_stride")].map(|name| lent.get(0, name, 0));
        let Some((len, ..)) = pixel_extent(width, height, stride, pixel) else { continue };
        if len > MAX_BYTES {
            lent.put("height", 0, 0);
            continue;
        }
        let mut memory = Memory::from_values(&calls::noise(len.div_ceil(4)), 1);
        lent.put(part, 0, memory.pointer() as u64);
        call.inputs.push(memory);
    }
}

/// Allocates the memory of colours of a higher degree.
fn back_arrays(call: &mut Call) {
    let at = call.position("arrays");
    let Value::Struct(lent) = &mut call.arguments[at].value else { return };
    if lent.stride < 64 {
        return;
    }
    let degree = lent.get(0, "sh_degree", 0);
    if (1..=3).contains(&degree) && lent.get(0, "sh", 0) != 0 {
        let mut memory = Memory::from_values(&vec![0.1f32; 3 * 3 * (degree as usize + 1).pow(2)], 0);
        lent.put("sh", 0, memory.pointer() as u64);
        call.inputs.push(memory);
    }
}

thread_local! {
    /// Number of calls after which the progress callback cancels; 0: never.
    static STOP_IN: Cell<usize> = const { Cell::new(0) };
}

unsafe extern "C" fn on_progress(stage: *const c_char, fraction: f64, _: *mut c_void) -> i32 {
    assert!(unsafe { CStr::from_ptr(stage) }.to_str().is_ok() && (0.0..=1.0).contains(&fraction));
    STOP_IN.set(STOP_IN.get().wrapping_sub(1));
    i32::from(STOP_IN.get() == 0)
}

unsafe extern "C" fn on_log(level: i32, message: *const c_char, _: *mut c_void) {
    let message = unsafe { CStr::from_ptr(message) }.to_str().expect("UTF-8");
    assert!((1..=3).contains(&level) && !message.is_empty() && !message.contains('\n'));
}
