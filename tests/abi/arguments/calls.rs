//! The functions of the header as data: for each that can fail, its arguments by name, with a valid value for each and
//! invalid ones. Running such a call also checks the promises that hold for every call, whatever its arguments.
//!
//! The table test and the fuzz target share this file; `super` gives `GUARD` and `vehicle`.
#![allow(unsafe_code, dead_code)] // each user needs a part

use super::GUARD;
use std::ffi::{CStr, CString, c_void};
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::ptr::{null, null_mut};
use vg::geometry::choice::Enumeration;
use vg::geometry::options::{Face, Field as TableField, Kind, Value as OptionValue};
use vg::pipeline::Options;
use vg_face::capi::*;
use vg_testing::tools::golden;
use vg_testing::vehicle;

/// The byte that fills guards and gaps.
pub const CANARY: u8 = 0xA5;

/// The value of an out parameter before the call: a dangling pointer.
const NOWHERE: usize = 0xDEAD_BEE0;

/// Memory passed to the library: exactly the promised bytes, at any address, between guards.
pub struct Memory {
    allocation: Vec<u8>,
    start: usize,
    before: Vec<u8>,
}

impl Memory {
    /// Memory `shift` bytes after an aligned address.
    pub fn new(content: &[u8], shift: usize) -> Self {
        let start = GUARD + shift;
        let mut allocation = Vec::with_capacity(start + content.len() + GUARD);
        allocation.resize(start, CANARY);
        allocation.extend_from_slice(content);
        allocation.resize(start + content.len() + GUARD, CANARY);
        Self { before: allocation.clone(), start, allocation }
    }

    pub fn from_values<T: Copy>(values: &[T], shift: usize) -> Self {
        Self::new(bytes_of(values), shift)
    }

    pub fn pointer(&mut self) -> usize {
        unsafe { self.allocation.as_mut_ptr().add(self.start) }.expose_provenance()
    }

    pub fn content(&self) -> &[u8] {
        &self.allocation[self.start..self.allocation.len() - GUARD]
    }

    /// Changes the content before the call.
    pub fn poke(&mut self, at: usize, bytes: &[u8]) {
        let at = self.start + at;
        self.allocation[at..at + bytes.len()].copy_from_slice(bytes);
        self.before = self.allocation.clone();
    }

    pub fn is_unchanged(&self) -> bool {
        self.allocation == self.before
    }

    pub fn guards_are_unchanged(&self) -> bool {
        let end = self.allocation.len() - GUARD;
        let guards = |bytes: &[u8]| bytes[..self.start].iter().chain(&bytes[end..]).all(|&b| b == CANARY);
        guards(&self.allocation)
    }

    pub fn doubles(&self) -> Vec<f64> {
        self.content().chunks_exact(8).map(|b| f64::from_ne_bytes(b.try_into().unwrap())).collect()
    }
}

/// The bytes of an array of numbers.
pub fn bytes_of<T: Copy>(values: &[T]) -> &[u8] {
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// The expected result for a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    Fine,
    Refused,
    NotBuilt,
}
use Outcome::{Fine, NotBuilt, Refused};

/// Values of a number with their expected results; the lowest bytes are used.
pub type Tries = Vec<(u64, Outcome)>;

/// Numbers that are in no enumeration.
const NO_CHOICE: [i32; 4] = [-1, 77, i32::MIN, i32::MAX];

pub fn bits32(value: i32) -> u64 {
    u64::from(value.cast_unsigned())
}

/// Values of an enumeration.
pub fn choice(good: &[i32]) -> Tries {
    let good = good.iter().map(|&n| (bits32(n), Fine));
    good.chain(NO_CHOICE.map(|n| (bits32(n), Refused))).collect()
}

/// Values of an enumeration with one that this build lacks.
fn choice_without(good: &[i32], missing: i32) -> Tries {
    let mut tries = choice(good);
    tries.push((bits32(missing), NotBuilt));
    tries
}

/// A reserved field.
fn reserved() -> Tries {
    vec![(0, Fine), (1, Refused), (1 << 31, Refused), (u64::MAX, Refused)]
}

fn within32(low: f32, high: f32) -> Tries {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, low.next_down(), high.next_up(), -1e30, 1e30];
    let good = [low, high].map(|v| (u64::from(v.to_bits()), Fine));
    good.into_iter().chain(bad.map(|v| (u64::from(v.to_bits()), Refused))).collect()
}

fn within64(low: f64, high: f64) -> Tries {
    let bad = [low.next_down(), high.next_up(), -1e300, 1e300].map(|v| (v.to_bits(), Refused));
    [(low.to_bits(), Fine), (high.to_bits(), Fine)].into_iter().chain(bad).chain(finite()).collect()
}

/// A floating-point number that must be finite.
fn finite() -> Tries {
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|v| (v.to_bits(), Refused)).to_vec()
}

/// A share, above 0 to 1.
fn share() -> Tries {
    let bad = [0.0, -0.0, -0.5, 1f64.next_up(), 1e300].map(|v| (v.to_bits(), Refused));
    [0.5f64, 1.0].map(|v| (v.to_bits(), Fine)).into_iter().chain(bad).chain(finite()).collect()
}

/// Seconds, 0 for none.
fn budget() -> Tries {
    let good = [0.0f64, -0.0, 1e6].map(|v| (v.to_bits(), Fine));
    good.into_iter()
        .chain([(-1.0f64).to_bits(), (-5e-324f64).to_bits()].map(|b| (b, Refused)))
        .chain(finite())
        .collect()
}

/// Seconds, 0 for none, small enough to run.
fn refine_seconds() -> Tries {
    let good = [0.0f64, -0.0, 1e-9].map(|v| (v.to_bits(), Fine));
    let bad = [-1.0f64, -5e-324, 86401.0].map(|v| (v.to_bits(), Refused));
    good.into_iter().chain(bad).chain(finite()).collect()
}

fn sizes() -> Tries {
    [0, 8193, 1 << 31, u32::MAX].map(|v| (u64::from(v), Refused)).to_vec()
}

fn counts(bad: &[u64]) -> Tries {
    bad.iter().map(|&n| (n, Refused)).collect()
}

/// Pointers and their sizes, which have rows of their own.
fn elsewhere() -> Tries {
    Vec::new()
}

/// A field of a struct.
#[derive(Clone)]
pub struct Field {
    pub name: String,
    /// Its name in errors.
    pub word: String,
    pub offset: usize,
    /// Bytes of one element.
    pub size: usize,
    pub count: usize,
    /// Values to try for every element.
    pub tries: Tries,
}

fn member_size<T, F>(_: fn(&T) -> &F) -> usize {
    size_of::<F>()
}

macro_rules! fields {
    ($type:ty { $($name:ident $([$count:literal])? $(as $word:literal)? : $tries:expr),* $(,)? }) => {
        vec![$({
            let count = [$($count,)? 1usize][0];
            let word: &str = [$($word,)? stringify!($name)][0];
            Field {
                name: stringify!($name).into(),
                word: word.into(),
                offset: offset_of!($type, $name),
                size: member_size(|s: &$type| &s.$name) / count,
                count,
                tries: $tries,
            }
        }),*]
    };
}

/// Fields of a struct inside a struct.
fn inside(name: &str, offset: usize, fields: Vec<Field>) -> Vec<Field> {
    let inner = |f: Field| Field {
        name: format!("{name}.{}", f.name),
        word: if f.word.is_empty() { name.into() } else { format!("{name}.{}", f.word) },
        offset: offset + f.offset,
        ..f
    };
    fields.into_iter().map(inner).collect()
}

fn camera_fields() -> Vec<Field> {
    fields!(vg_camera {
        struct_size: elsewhere(),
        width as "": sizes(),
        height as "": sizes(),
        model: choice(&[1]),
        flags: reserved(),
        params[16] as "": finite(),
        vehicle_from_camera[12]: finite(),
        reserved[4]: reserved(),
    })
}

fn image_fields(formats: &[i32]) -> Vec<Field> {
    fields!(vg_image {
        data: elsewhere(),
        row_stride: counts(&[1, 35, usize::MAX as u64, usize::MAX as u64 / 2, (isize::MAX / 35) as u64]),
        width as "": sizes(),
        height as "": sizes(),
        format: choice(formats),
        flags: reserved(),
    })
}

fn view_fields() -> Vec<Field> {
    let mut all = fields!(vg_view { struct_size: elsewhere(), name: elsewhere() });
    all.extend(inside("camera", offset_of!(vg_view, camera), camera_fields()));
    all.extend(inside("image", offset_of!(vg_view, image), image_fields(&[1, 2, 3, 4, 5])));
    all.extend(inside("mask", offset_of!(vg_view, mask), image_fields(&[5])));
    all.extend(inside("depth", offset_of!(vg_view, depth), image_fields(&[7])));
    all
}

/// A struct argument, or an array of structs.
#[derive(Clone)]
pub struct Lent {
    pub of: &'static str,
    pub bytes: Vec<u8>,
    /// Bytes from one element to the next; also the `struct_size`, unless a row sets another one.
    pub stride: usize,
    pub count: usize,
    pub shift: usize,
    pub fields: Vec<Field>,
    /// Names of elements in errors, `views[0]`.
    pub is_array: bool,
}

impl Lent {
    fn new<T: Copy>(of: &'static str, values: &[T], fields: Vec<Field>) -> Self {
        Self::from_bytes::<T>(of, bytes_of(values).to_vec(), fields)
    }

    /// Zeros, except for the size.
    fn zeroed<T: Copy>(of: &'static str, fields: Vec<Field>) -> Self {
        let mut lent = Self::from_bytes::<T>(of, vec![0; size_of::<T>()], fields);
        lent.claim(0, size_of::<T>());
        lent
    }

    fn from_bytes<T>(of: &'static str, bytes: Vec<u8>, fields: Vec<Field>) -> Self {
        let covered: usize = fields.iter().map(|f| f.size * f.count).sum();
        assert_eq!(covered, size_of::<T>(), "the table has every field of {of}");
        let count = bytes.len() / covered;
        Self { of, bytes, stride: covered, count, shift: 0, fields, is_array: count > 1 }
    }

    pub fn field(&self, name: &str) -> &Field {
        self.fields.iter().find(|f| f.name == name).unwrap_or_else(|| panic!("{} has no {name}", self.of))
    }

    /// Sets element `index` of a field of the first struct; the lowest bytes of `value`.
    pub fn put(&mut self, name: &str, index: usize, value: u64) {
        self.put_in(0, name, index, value);
    }

    pub fn put_in(&mut self, element: usize, name: &str, index: usize, value: u64) {
        let field = self.field(name);
        let (at, size) = (element * self.stride + field.offset + index * field.size, field.size);
        self.bytes[at..at + size].copy_from_slice(&value.to_le_bytes()[..size]);
    }

    pub fn get(&self, element: usize, name: &str, index: usize) -> u64 {
        let field = self.field(name);
        let at = element * self.stride + field.offset + index * field.size;
        let mut bytes = [0; 8];
        bytes[..field.size].copy_from_slice(&self.bytes[at..at + field.size]);
        u64::from_le_bytes(bytes)
    }

    /// Makes every element `size` bytes long and sets `struct_size`; added bytes are `fill`. The 8 bytes of the size
    /// are always there.
    pub fn resize(&mut self, size: usize, fill: u8) {
        let (old, new) = (self.stride, size.max(8));
        let mut bytes = Vec::with_capacity(new * self.count);
        for element in self.bytes.chunks_exact(old) {
            let start = bytes.len();
            bytes.extend_from_slice(&element[..old.min(new)]);
            bytes.resize(start + new, fill);
            bytes[start..start + 8].copy_from_slice(&(size as u64).to_le_bytes());
        }
        (self.bytes, self.stride) = (bytes, new);
    }

    pub fn claim(&mut self, element: usize, size: usize) {
        self.put_in(element, "struct_size", 0, size as u64);
    }
}

/// The kind of a returned handle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Made {
    Context,
    Gaussians,
    Report,
    Scene,
    Model,
    Renderer,
}

impl Made {
    pub unsafe fn free(self, handle: usize) {
        unsafe {
            match self {
                Self::Context => vg_context_free(handle as _),
                Self::Gaussians => vg_gaussians_free(handle as _),
                Self::Report => vg_report_free(handle as _),
                Self::Scene => vg_scene_free(handle as _),
                Self::Model => vg_model_free(handle as _),
                Self::Renderer => vg_renderer_free(handle as _),
            }
        }
    }
}

/// The kind of an argument.
#[derive(Clone)]
pub enum Value {
    Null,
    /// By value.
    Number(u64),
    /// Read only.
    Doubles(Vec<f64>),
    Text(CString),
    /// A handle of the world.
    Handle(usize),
    Struct(Lent),
    OutHandle(Made),
    OutDoubles(usize),
    OutStruct(Lent),
}

pub struct Argument {
    pub name: &'static str,
    /// Its name in errors.
    pub word: &'static str,
    pub value: Value,
    pub nullable: bool,
    /// Values of a number, or of each of the doubles.
    pub tries: Tries,
}

/// A picture that the library writes: rows of `row` bytes, `stride` apart.
pub struct Target {
    pub memory: Memory,
    pub row: usize,
    pub stride: usize,
    pub is_float: bool,
}

type Invoke = unsafe fn(&[usize], *mut *mut vg_error) -> vg_status;

/// A call with all its arguments.
pub struct Call {
    pub function: &'static str,
    pub arguments: Vec<Argument>,
    /// Memory that structs point to, read only.
    pub inputs: Vec<Memory>,
    pub targets: Vec<Target>,
    invoke: Invoke,
    /// Whether there is an `out_error`.
    has_error: bool,
    /// The status if its arguments are valid.
    pub good: vg_status,
}

/// The results of a call.
pub struct Done {
    pub status: vg_status,
    /// The message; empty without `out_error`.
    pub message: String,
    /// The memory of the arguments after the call, by argument; handles of a successful call.
    pub memory: Vec<Option<Memory>>,
    pub handles: Vec<(&'static str, Made, usize)>,
}

impl Done {
    pub fn is_ok(&self) -> bool {
        self.status == vg_status::Ok
    }

    pub fn handle(&self, name: &str) -> usize {
        self.handles.iter().find(|(n, ..)| *n == name).map_or(0, |h| h.2)
    }
}

impl Drop for Done {
    fn drop(&mut self) {
        for &(_, made, handle) in &self.handles {
            unsafe { made.free(handle) };
        }
    }
}

/// A call of a function of the header with all its arguments as words.
macro_rules! invoke {
    ($function:ident $($index:literal)*) => {
        |a, error| unsafe { $function($(a[$index] as _,)* error) }
    };
}

/// An `_init` function, which reports no error.
macro_rules! invoke_init {
    ($function:ident) => {
        |a, _| unsafe { $function(a[0] as _, a[1]) }
    };
}

impl Call {
    fn new(function: &'static str, invoke: Invoke) -> Self {
        Self {
            function,
            arguments: vec![],
            inputs: vec![],
            targets: vec![],
            invoke,
            has_error: true,
            good: vg_status::Ok,
        }
    }

    fn argument(mut self, name: &'static str, value: Value) -> Self {
        self.arguments.push(Argument { name, word: name, value, nullable: false, tries: vec![] });
        self
    }

    fn last(&mut self) -> &mut Argument {
        self.arguments.last_mut().expect("an argument")
    }

    fn nullable(mut self) -> Self {
        self.last().nullable = true;
        self
    }

    fn tries(mut self, tries: Tries) -> Self {
        self.last().tries = tries;
        self
    }

    /// Its name in errors if that differs.
    fn word(mut self, word: &'static str) -> Self {
        self.last().word = word;
        self
    }

    fn memory(mut self, memory: Vec<Memory>) -> Self {
        self.inputs.extend(memory);
        self
    }

    pub fn position(&self, name: &str) -> usize {
        let found = self.arguments.iter().position(|a| a.name == name);
        found.unwrap_or_else(|| panic!("{} has no {name}", self.function))
    }

    pub fn set(&mut self, name: &str, value: Value) {
        let at = self.position(name);
        self.arguments[at].value = value;
    }

    pub fn lent(&mut self, name: &str) -> &mut Lent {
        let at = self.position(name);
        match &mut self.arguments[at].value {
            Value::Struct(lent) | Value::OutStruct(lent) => lent,
            _ => panic!("{} {name} is no struct", self.function),
        }
    }

    pub fn doubles(&mut self, name: &str) -> &mut Vec<f64> {
        let at = self.position(name);
        match &mut self.arguments[at].value {
            Value::Doubles(values) => values,
            _ => panic!("{} {name} is no array of double", self.function),
        }
    }

    /// Makes the call and checks the promises that hold for all calls.
    ///
    /// # Panics
    /// If one of the promises of the header is broken.
    pub fn run(&mut self, with_error: bool) -> Done {
        let mut memory: Vec<Option<Memory>> = self.arguments.iter().map(|a| lend(&a.value)).collect();
        let mut slots = vec![NOWHERE; self.arguments.len()];
        let mut words = Vec::with_capacity(self.arguments.len());
        for ((argument, memory), slot) in self.arguments.iter().zip(&mut memory).zip(&mut slots) {
            words.push(match (&argument.value, memory) {
                (_, Some(memory)) => memory.pointer(),
                (Value::Number(value), _) => *value as usize,
                (Value::Handle(handle), _) => *handle,
                (Value::OutHandle(_), _) => (&raw mut *slot).expose_provenance(),
                _ => 0,
            });
        }
        let mut error: *mut vg_error = std::ptr::with_exposed_provenance_mut(NOWHERE);
        let out_error = if with_error { &raw mut error } else { null_mut() };
        let errno = unusual_errno();
        let status = unsafe { (self.invoke)(&words, out_error) };
        assert_eq!(std::io::Error::last_os_error().raw_os_error(), errno, "{}: errno", self.function);

        let has_error = with_error && self.has_error;
        let message = if has_error { unsafe { taken(error, status) } } else { String::new() };
        let mut done = Done { status, message, memory, handles: vec![] };
        for (argument, &slot) in self.arguments.iter().zip(&slots) {
            if let Value::OutHandle(made) = argument.value {
                match status {
                    vg_status::Ok => {
                        assert!(
                            slot != 0 && slot != NOWHERE,
                            "{}: {} was not set",
                            self.function,
                            argument.name
                        );
                        done.handles.push((argument.name, made, slot));
                    }
                    _ => assert_eq!(
                        slot, 0,
                        "{}: {} is not NULL after a failure",
                        self.function, argument.name
                    ),
                }
            }
        }
        self.check(&done);
        done
    }

    fn check(&self, done: &Done) {
        let call = || format!("{}: {:?} {}", self.function, done.status, done.message);
        assert_ne!(done.status, vg_status::Internal, "{}", call());
        for (argument, memory) in self.arguments.iter().zip(&done.memory) {
            let Some(memory) = memory else { continue };
            let may_change =
                done.is_ok() && matches!(argument.value, Value::OutDoubles(_) | Value::OutStruct(_));
            assert!(may_change || memory.is_unchanged(), "{}: {} was changed", call(), argument.name);
            assert!(memory.guards_are_unchanged(), "{}: written beside {}", call(), argument.name);
            if may_change && matches!(argument.value, Value::OutDoubles(_)) {
                assert!(memory.doubles().iter().all(|v| v.is_finite()), "{}: not finite", call());
            }
        }
        assert!(self.inputs.iter().all(Memory::is_unchanged), "{}: input was changed", call());
        for target in &self.targets {
            assert!(done.is_ok() || target.memory.is_unchanged(), "{}: the target was changed", call());
            assert!(target.memory.guards_are_unchanged(), "{}: written beside the target", call());
            let rows = target.memory.content().chunks(target.stride.max(1));
            for row in rows {
                assert!(row[target.row.min(row.len())..].iter().all(|&b| b == CANARY), "{}: a gap", call());
                if done.is_ok() && target.is_float {
                    let mut floats = row[..target.row].chunks_exact(4);
                    let finite = floats.all(|b| f32::from_ne_bytes(b.try_into().unwrap()).is_finite());
                    assert!(finite, "{}: not finite", call());
                }
            }
        }
        for &(_, made, handle) in &done.handles {
            if made == Made::Gaussians {
                unsafe { check_gaussians(handle as _) }
            }
        }
    }
}

/// Sets an errno that no call of the library produces.
fn unusual_errno() -> Option<i32> {
    // Opening a file as a folder fails with ENOTDIR.
    let _ = std::fs::metadata(std::env::current_exe().unwrap_or_default().join("in it"));
    std::io::Error::last_os_error().raw_os_error()
}

/// Checks the invariants of Gaussians.
unsafe fn check_gaussians(gaussians: *const vg_gaussians) {
    unsafe {
        let n = vg_gaussians_count(gaussians);
        let degree = vg_gaussians_sh_degree(gaussians) as usize;
        let floats = |pointer: *const f32, each: usize| match n {
            0 => {
                assert!(pointer.is_null(), "no Gaussians, no array");
                &[]
            }
            _ => std::slice::from_raw_parts(pointer, n * each),
        };
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        assert!(finite(floats(vg_gaussians_positions(gaussians), 3)), "positions are finite");
        assert!(finite(floats(vg_gaussians_sh(gaussians), (degree + 1).pow(2) * 3)), "colours are finite");
        let scales = floats(vg_gaussians_scales(gaussians), 3);
        assert!(finite(scales) && scales.iter().all(|&s| s > 0.0), "scales are positive");
        assert!(floats(vg_gaussians_opacities(gaussians), 1).iter().all(|o| (0.0..=1.0).contains(o)));
        for q in floats(vg_gaussians_rotations(gaussians), 4).chunks_exact(4) {
            let norm: f32 = q.iter().map(|v| v * v).sum();
            // The sum of four squares of rounded numbers.
            assert!((norm - 1.0).abs() < 1e-5, "rotations are unit quaternions: {q:?}");
        }
    }
}

fn lend(value: &Value) -> Option<Memory> {
    match value {
        Value::Doubles(values) => Some(Memory::from_values(values, 0)),
        Value::Text(text) => Some(Memory::new(text.as_bytes_with_nul(), 0)),
        Value::Struct(lent) | Value::OutStruct(lent) => Some(Memory::new(&lent.bytes, lent.shift)),
        Value::OutDoubles(count) => Some(Memory::new(&vec![CANARY; count * 8], 0)),
        Value::Null | Value::Number(_) | Value::Handle(_) | Value::OutHandle(_) => None,
    }
}

/// Returns the message of the error and frees it.
unsafe fn taken(error: *mut vg_error, status: vg_status) -> String {
    assert_ne!(error.addr(), NOWHERE, "out_error was not set");
    unsafe {
        assert_eq!(vg_error_code(error), status);
        let message = CStr::from_ptr(vg_error_message(error)).to_str().expect("UTF-8").to_owned();
        assert_eq!(error.is_null(), status == vg_status::Ok, "{message}");
        assert_eq!(message.is_empty(), status == vg_status::Ok, "{status:?} without a message");
        assert!(!message.contains(['\n', '\r']), "one line: {message:?}");
        if status == vg_status::Argument {
            assert!(message.contains(": ") && message.contains("; allowed: "), "found, allowed: {message}");
        }
        vg_error_free(error);
        message
    }
}

/// The memory of a photograph in C.
pub struct Photograph {
    pub camera: vg_camera,
    pub rgb: Vec<u8>,
    pub mask: Vec<u8>,
    pub depth: Vec<f32>,
}

/// Handles and pictures used by calls.
pub struct World {
    /// Threads of the context.
    pub threads: u32,
    pub context: usize,
    pub gaussians: usize,
    /// Three Gaussians, of degree 0.
    pub few: usize,
    pub report: usize,
    pub renderer: usize,
    pub scene: usize,
    pub photographs: Vec<Photograph>,
    /// A folder with a `transforms.json`, a COLMAP model, pictures and depth.
    pub sample: PathBuf,
    pub scratch: PathBuf,
}

pub const WIDTH: u32 = 48;
pub const HEIGHT: u32 = 36;

impl World {
    pub fn new(sample: &Path, scratch: &Path) -> Self {
        Self::on_threads(2, sample, scratch)
    }

    pub fn on_threads(threads: u32, sample: &Path, scratch: &Path) -> Self {
        let mut world = Self {
            threads,
            context: 0,
            gaussians: 0,
            few: 0,
            report: 0,
            renderer: 0,
            scene: 0,
            photographs: vehicle::right_side(WIDTH, HEIGHT).views.iter().map(photograph).collect(),
            sample: sample.to_owned(),
            scratch: scratch.to_owned(),
        };
        let keep = |mut done: Done, name: &str| {
            assert!(done.is_ok(), "{}", done.message);
            let at = done.handles.iter().position(|h| h.0 == name).expect("the handle");
            done.handles.swap_remove(at).2
        };
        world.context = keep(context_new(&world).run(true), "out");
        world.few = keep(gaussians_from_arrays(&world).run(true), "out");
        let mut call = reconstruct(&world);
        call.lent("options").put("points", 0, 1);
        let mut done = call.run(true);
        assert!(done.is_ok(), "{}", done.message);
        (world.gaussians, world.report) = (done.handle("out_gaussians"), done.handle("out_report"));
        done.handles.clear();
        world.gaussians_saved();
        world.renderer = keep(renderer_new(&world).run(true), "out");
        world.scene = keep(transforms_open(&world).run(true), "out");
        world
    }

    /// The file that `vg_gaussians_load_ply` reads.
    fn gaussians_saved(&self) {
        let path = text(self.scratch.join("few.ply"));
        let status = unsafe { vg_gaussians_save_ply(self.few as _, path.as_ptr(), null_mut()) };
        assert_eq!(status, vg_status::Ok);
    }

    fn camera(&self) -> Lent {
        Lent::new("vg_camera", &[self.photographs[0].camera], camera_fields())
    }

    /// The views in several formats, some with gaps between rows, some at odd addresses.
    pub fn views(&self) -> (Lent, Vec<Memory>) {
        let mut memory = Vec::new();
        let views: Vec<vg_view> =
            self.photographs.iter().enumerate().map(|(i, p)| p.view(i, &mut memory)).collect();
        (Lent::new("vg_view", &views, view_fields()), memory)
    }
}

impl Drop for World {
    fn drop(&mut self) {
        unsafe {
            vg_scene_free(self.scene as _);
            vg_renderer_free(self.renderer as _);
            vg_report_free(self.report as _);
            vg_gaussians_free(self.few as _);
            vg_gaussians_free(self.gaussians as _);
            vg_context_free(self.context as _);
        }
    }
}

pub fn text(path: impl AsRef<Path>) -> CString {
    CString::new(path.as_ref().to_str().expect("UTF-8")).expect("no NUL")
}

fn photograph(view: &vg::View) -> Photograph {
    let (i, mut params) = (view.camera.intrinsics, [0.0; 16]);
    params[..4].copy_from_slice(&[i.fx, i.fy, i.cx, i.cy]);
    let camera = vg_camera {
        struct_size: size_of::<vg_camera>(),
        width: view.camera.width,
        height: view.camera.height,
        model: vg_camera_model::Pinhole as i32,
        flags: 0,
        params,
        vehicle_from_camera: view.camera.vehicle_from_camera.to_row_major(),
        reserved: [0; 4],
    };
    Photograph {
        camera,
        rgb: view.image.pixels().as_flattened().to_vec(),
        mask: view.mask.as_ref().unwrap().labels().iter().map(|&l| l as u8).collect(),
        depth: view.depth.as_ref().unwrap().depth().to_vec(),
    }
}

/// Rows of `row` bytes, `stride` apart, the gaps and what follows holding noise.
fn spread(content: &[u8], row: usize, stride: usize, extra: usize) -> Vec<u8> {
    let mut out: Vec<u8> = Vec::new();
    for bytes in content.chunks_exact(row) {
        out.extend_from_slice(bytes);
        out.resize(out.len() + stride - row, 0x5A);
    }
    out.resize(out.len() + extra, 0x5A);
    out
}

impl Photograph {
    fn view(&self, i: usize, memory: &mut Vec<Memory>) -> vg_view {
        let width = WIDTH as usize;
        let mut image = |bytes: Vec<u8>, shift: usize, stride: usize, format: vg_format| {
            let mut lent = Memory::new(&bytes, shift);
            let data = lent.pointer() as *const c_void;
            memory.push(lent);
            let (width, height) = (self.camera.width, self.camera.height);
            vg_image { data, row_stride: stride, width, height, format: format as i32, flags: 0 }
        };
        let masked = |order: [usize; 4]| -> Vec<u8> {
            let pixels = self.rgb.chunks_exact(3).zip(&self.mask);
            pixels.flat_map(|(p, &m)| order.map(|k| [p[0], p[1], p[2], m][k])).collect()
        };
        let photograph = match i {
            // Large enough for four bytes per pixel.
            0 => image(spread(&self.rgb, width * 3, width * 4 + 5, 0), 1, width * 4 + 5, vg_format::Rgb8),
            1 => image(self.rgb.clone(), 0, 0, vg_format::Rgb8),
            2 => image(masked([2, 1, 0, 3]), 3, 0, vg_format::Bgra8),
            _ => image(masked([0, 1, 2, 3]), 0, 0, vg_format::Rgba8),
        };
        // Views with an odd index have the mask in the photograph's alpha.
        let mask = match i {
            0 => image(spread(&self.mask, width, width + 3, 0), 1, width + 3, vg_format::Gray8),
            1 => image(self.mask.clone(), 0, 0, vg_format::Gray8),
            _ => vg_image { data: null(), row_stride: 0, width: 0, height: 0, format: 0, flags: 0 },
        };
        let depth = bytes_of(&self.depth);
        let depth = match i {
            // Rows that are not aligned to floats.
            0 => image(spread(depth, width * 4, width * 4 + 3, 0), 1, width * 4 + 3, vg_format::Depth32f),
            _ => image(depth.to_vec(), 0, 0, vg_format::Depth32f),
        };
        vg_view {
            struct_size: size_of::<vg_view>(),
            name: null(),
            camera: self.camera,
            image: photograph,
            mask,
            depth,
        }
    }
}

const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A similarity: scale 2, a rotation by 90 degrees about z, and a translation.
const SIMILARITY: [f64; 16] =
    [0.0, -2.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.5, 0.0, 0.0, 0.0, 1.0];

/// A valid pose far from that of the camera.
const POSE: [f64; 12] = [0.0, -1.0, 0.0, 4e5, 1.0, 0.0, 0.0, 5e6, 0.0, 0.0, 1.0, 100.0];

/// A valid call of each function that can fail.
pub const CALLS: [fn(&World) -> Call; 72] = [
    context_options_init,
    context_new,
    camera_init,
    camera_from_colmap_model,
    camera_from_opencv,
    camera_scale,
    camera_crop,
    pose_from_colmap,
    pose_from_opengl,
    pose_from_opencv,
    pose_from_box,
    camera_project,
    pose_look_at,
    camera_look_at,
    cameras_turntable,
    camera_project_points,
    camera_unproject,
    camera_unproject_points,
    view_init,
    model_options_init,
    model_open,
    options_init,
    report_figures_init,
    report_get_figures,
    gaussian_arrays_init,
    gaussians_load_ply,
    gaussians_save_ply,
    gaussians_from_arrays,
    gaussians_transform,
    gaussians_mirror,
    gaussians_merge,
    gaussians_select,
    gaussians_mask,
    gaussians_crop,
    gaussians_covariances,
    gaussians_load_ply_memory,
    gaussians_save_ply_memory,
    reconstruct,
    refine_options_init,
    refinement_init,
    refine,
    render_options_init,
    image_target_init,
    render,
    render_through_a_lens,
    renderer_options_init,
    renderer_new,
    renderer_render,
    image_gradient_init,
    gradients_init,
    render_backward,
    render_backward_through_a_lens,
    render_backward_with_a_picture,
    segment_options_init,
    segment,
    metrics_options_init,
    picture_errors_init,
    view_errors_init,
    surface_errors_init,
    metrics_pictures,
    metrics_view,
    metrics_surface,
    align_options_init,
    alignment_init,
    align_scan,
    align_box,
    align_points,
    align_folder,
    scene_options_init,
    colmap_open,
    transforms_open,
    scene_get_view,
];

/// `sizeof` in the release that introduced each struct: no caller has a shorter one.
pub const FIRST_SIZES: [(&str, usize); 22] = [
    ("vg_context_options", 16),
    ("vg_camera", 280),
    ("vg_view", 392),
    ("vg_model_options", 40),
    ("vg_options", 96),
    ("vg_report_figures", 152),
    ("vg_gaussian_arrays", 64),
    ("vg_refine_options", 64),
    ("vg_refinement", 56),
    ("vg_render_options", 72),
    ("vg_renderer_options", 24),
    ("vg_image_target", 56),
    ("vg_image_gradient", 88),
    ("vg_gradients", 88),
    ("vg_segment_options", 24),
    ("vg_metrics_options", 40),
    ("vg_picture_errors", 32),
    ("vg_view_errors", 64),
    ("vg_surface_errors", 80),
    ("vg_align_options", 24),
    ("vg_alignment", 184),
    ("vg_scene_options", 72),
];

fn init(function: &'static str, invoke: Invoke, name: &'static str, target: Lent) -> Call {
    let size = target.stride as u64;
    let first = FIRST_SIZES.iter().find(|(of, _)| *of == target.of).expect("a struct that says its size").1;
    let mut call = Call::new(function, invoke)
        .argument(name, Value::OutStruct(Lent { bytes: vec![CANARY; target.stride], ..target }))
        .argument("size", Value::Number(size))
        .tries(counts(&[0, 1, first as u64 - 1, 4097, usize::MAX as u64]));
    call.has_error = false;
    call
}

macro_rules! init_of {
    ($rust:ident, $function:ident, $name:literal, $lent:expr) => {
        pub fn $rust(_: &World) -> Call {
            init(stringify!($function), invoke_init!($function), $name, $lent)
        }
    };
}

init_of!(context_options_init, vg_context_options_init, "options", context_options());
init_of!(camera_init, vg_camera_init, "camera", Lent::zeroed::<vg_camera>("vg_camera", camera_fields()));
init_of!(view_init, vg_view_init, "view", Lent::zeroed::<vg_view>("vg_view", view_fields()));
init_of!(model_options_init, vg_model_options_init, "options", model_options());
init_of!(options_init, vg_options_init, "options", options(0));
init_of!(report_figures_init, vg_report_figures_init, "figures", figures());
init_of!(gaussian_arrays_init, vg_gaussian_arrays_init, "arrays", arrays(0, [0; 5], 0));
init_of!(refine_options_init, vg_refine_options_init, "options", refine_options(0));
init_of!(refinement_init, vg_refinement_init, "refinement", refinement());
init_of!(render_options_init, vg_render_options_init, "options", render_options(0));
init_of!(renderer_options_init, vg_renderer_options_init, "options", renderer_options(0));
init_of!(image_target_init, vg_image_target_init, "target", target([(0, 0); 3]));
init_of!(image_gradient_init, vg_image_gradient_init, "gradient", image_gradient([0; 3]));
init_of!(gradients_init, vg_gradients_init, "gradients", gradients(0, 0, [0; 8]));
init_of!(segment_options_init, vg_segment_options_init, "options", segment_options(0));
init_of!(metrics_options_init, vg_metrics_options_init, "options", metrics_options(0));
init_of!(picture_errors_init, vg_picture_errors_init, "errors", picture_errors());
init_of!(view_errors_init, vg_view_errors_init, "errors", view_errors());
init_of!(surface_errors_init, vg_surface_errors_init, "errors", surface_errors());
init_of!(align_options_init, vg_align_options_init, "options", align_options(0));
init_of!(alignment_init, vg_alignment_init, "alignment", alignment());
init_of!(scene_options_init, vg_scene_options_init, "options", scene_options(0));

fn context_options() -> Lent {
    let fields = fields!(vg_context_options {
        struct_size: elsewhere(),
        threads: counts(&[1025, 1 << 31, u64::from(u32::MAX)]),
        flags: reserved(),
    });
    let mut lent = Lent::zeroed::<vg_context_options>("vg_context_options", fields);
    lent.put("threads", 0, 2);
    lent
}

pub fn context_new(w: &World) -> Call {
    let mut options = context_options();
    options.put("threads", 0, w.threads.into());
    Call::new("vg_context_new", invoke!(vg_context_new 0 1))
        .argument("options", Value::Struct(options))
        .nullable()
        .argument("out", Value::OutHandle(Made::Context))
}

pub fn camera_from_colmap_model(w: &World) -> Call {
    Call::new("vg_camera_from_colmap_model", invoke!(vg_camera_from_colmap_model 0 1 2 3 4 5 6))
        .argument("model", Value::Number(1))
        .tries(choice(&[1]))
        .argument("params", Value::Doubles(vec![100.0, 110.0, 31.5, 24.0]))
        .word("camera")
        .tries(finite())
        .argument("param_count", Value::Number(4))
        .tries(counts(&[0, 3, 5, 16, 1 << 40, usize::MAX as u64]))
        .argument("width", Value::Number(63))
        .word("size")
        .tries(sizes())
        .argument("height", Value::Number(48))
        .word("size")
        .tries(sizes())
        .argument("vehicle_from_camera", Value::Doubles(IDENTITY.to_vec()))
        .nullable()
        .tries(finite())
        .argument("out", Value::OutStruct(w.camera()))
}

pub fn camera_from_opencv(w: &World) -> Call {
    Call::new("vg_camera_from_opencv", invoke!(vg_camera_from_opencv 0 1 2 3 4 5 6 7))
        .argument("k", Value::Doubles(vec![100.0, 0.0, 31.0, 0.0, 110.0, 23.5, 0.0, 0.0, 1.0]))
        .word("camera")
        .tries(finite())
        .argument("distortion", Value::Doubles(vec![0.1, 0.01, 0.001, 0.002]))
        .tries(finite())
        .argument("distortion_count", Value::Number(4))
        .word("distortion")
        .tries(counts(&[1, 2, 3]))
        .argument("fisheye", Value::Number(0))
        .tries(choice(&[0, 1]))
        .argument("width", Value::Number(63))
        .word("size")
        .tries(sizes())
        .argument("height", Value::Number(48))
        .word("size")
        .tries(sizes())
        .argument("vehicle_from_camera", Value::Doubles(IDENTITY.to_vec()))
        .nullable()
        .tries(finite())
        .argument("out", Value::OutStruct(w.camera()))
}

pub fn camera_scale(w: &World) -> Call {
    Call::new("vg_camera_scale", invoke!(vg_camera_scale 0 1 2 3))
        .argument("camera", Value::Struct(w.camera()))
        .argument("width", Value::Number(24))
        .word("size")
        .tries(sizes())
        .argument("height", Value::Number(18))
        .word("size")
        .tries(sizes())
        .argument("out", Value::OutStruct(w.camera()))
}

pub fn camera_crop(w: &World) -> Call {
    Call::new("vg_camera_crop", invoke!(vg_camera_crop 0 1 2 3 4 5))
        .argument("camera", Value::Struct(w.camera()))
        .argument("x", Value::Number(10))
        .word("crop")
        .tries(counts(&[29, 48, u64::from(u32::MAX)]))
        .argument("y", Value::Number(8))
        .word("crop")
        .tries(counts(&[21, 36, u64::from(u32::MAX)]))
        .argument("width", Value::Number(20))
        .word("crop")
        .tries(counts(&[0, 39, u64::from(u32::MAX)]))
        .argument("height", Value::Number(16))
        .word("crop")
        .tries(counts(&[0, 29, u64::from(u32::MAX)]))
        .argument("out", Value::OutStruct(w.camera()))
}

pub fn pose_from_colmap(_: &World) -> Call {
    Call::new("vg_pose_from_colmap", invoke!(vg_pose_from_colmap 0 1 2 3))
        .argument("qvec", Value::Doubles(vec![2.0, 0.0, -1.0, 0.5]))
        .tries(finite())
        .argument("tvec", Value::Doubles(vec![1.0, 2.0, 3.0]))
        .tries(finite())
        .argument("vehicle_from_world", Value::Doubles(SIMILARITY.to_vec()))
        .nullable()
        .tries(finite())
        .argument("out", Value::OutDoubles(12))
}

pub fn pose_from_opengl(_: &World) -> Call {
    Call::new("vg_pose_from_opengl", invoke!(vg_pose_from_opengl 0 1 2))
        .argument("camera_to_world", Value::Doubles(POSE.to_vec()))
        .tries(finite())
        .argument("vehicle_from_world", Value::Doubles(SIMILARITY.to_vec()))
        .nullable()
        .tries(finite())
        .argument("out", Value::OutDoubles(12))
}

pub fn pose_from_box(_: &World) -> Call {
    Call::new("vg_pose_from_box", invoke!(vg_pose_from_box 0 1 2))
        .argument("vehicle_in_ego", Value::Doubles(POSE.to_vec()))
        .tries(finite())
        .argument("camera_in_ego", Value::Doubles(IDENTITY.to_vec()))
        .tries(finite())
        .argument("out", Value::OutDoubles(12))
}

pub fn camera_project(w: &World) -> Call {
    Call::new("vg_camera_project", invoke!(vg_camera_project 0 1 2))
        .argument("camera", Value::Struct(w.camera()))
        .argument("point_vehicle", Value::Doubles(vec![0.5, -0.25, 0.5]))
        .tries(finite())
        .argument("out_pixel", Value::OutDoubles(2))
}

pub fn pose_from_opencv(_: &World) -> Call {
    Call::new("vg_pose_from_opencv", invoke!(vg_pose_from_opencv 0 1 2 3))
        .argument("rvec", Value::Doubles(vec![0.3, -1.1, 0.7]))
        .tries(finite())
        .argument("tvec", Value::Doubles(vec![1.0, 2.0, 3.0]))
        .tries(finite())
        .argument("vehicle_from_world", Value::Doubles(SIMILARITY.to_vec()))
        .nullable()
        .tries(finite())
        .argument("out", Value::OutDoubles(12))
}

/// Position of a camera, its target, and up.
fn sight(call: Call) -> Call {
    call.argument("eye", Value::Doubles(vec![3.0, -4.0, 1.5]))
        .tries(finite())
        .argument("target", Value::Doubles(vec![0.1, 0.2, -0.3]))
        .tries(finite())
        .argument("up", Value::Doubles(vec![0.1, 0.0, 2.0]))
        .nullable()
        .tries(finite())
}

pub fn pose_look_at(_: &World) -> Call {
    sight(Call::new("vg_pose_look_at", invoke!(vg_pose_look_at 0 1 2 3)))
        .argument("out", Value::OutDoubles(12))
}

/// Bit patterns of a number passed by value, between these two, exclusive.
fn between(low: f64, high: f64) -> Tries {
    let bad = [low, high, -1e300, 1e300].map(|v| (v.to_bits(), Refused));
    bad.into_iter().chain(finite()).collect()
}

pub fn camera_look_at(w: &World) -> Call {
    let invoke: Invoke = |a, error| unsafe {
        let fov_y_degrees = f64::from_bits(a[3] as u64);
        vg_camera_look_at(
            a[0] as _,
            a[1] as _,
            a[2] as _,
            fov_y_degrees,
            a[4] as _,
            a[5] as _,
            a[6] as _,
            error,
        )
    };
    sight(Call::new("vg_camera_look_at", invoke))
        .argument("fov_y_degrees", Value::Number(40f64.to_bits()))
        .tries(between(0.0, 180.0))
        .argument("width", Value::Number(63))
        .word("size")
        .tries(sizes())
        .argument("height", Value::Number(48))
        .word("size")
        .tries(sizes())
        .argument("out", Value::OutStruct(w.camera()))
}

pub fn cameras_turntable(w: &World) -> Call {
    let invoke: Invoke = |a, error| unsafe {
        let [elevation_degrees, fov_y_degrees] = [a[2], a[3]].map(|bits| f64::from_bits(bits as u64));
        let (width, height) = (a[4] as _, a[5] as _);
        vg_cameras_turntable(
            a[0] as _,
            a[1] as _,
            elevation_degrees,
            fov_y_degrees,
            width,
            height,
            a[6] as _,
            error,
        )
    };
    Call::new("vg_cameras_turntable", invoke)
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("count", Value::Number(3))
        .tries(counts(&[0, 100_001, 1 << 60, u64::MAX]))
        .argument("elevation_degrees", Value::Number(12f64.to_bits()))
        .tries(within64(-89.0, 89.0))
        .argument("fov_y_degrees", Value::Number(35f64.to_bits()))
        .tries(between(0.0, 180.0))
        .argument("width", Value::Number(63))
        .word("size")
        .tries(sizes())
        .argument("height", Value::Number(48))
        .word("size")
        .tries(sizes())
        .argument(
            "out",
            Value::OutStruct(Lent::new("vg_camera", &[w.photographs[0].camera; 3], camera_fields())),
        )
}

/// Points on the vehicle, all in front of the camera.
const POINTS: [f64; 6] = [0.5, -0.25, 0.5, -1.0, 0.25, 0.0];

/// A size larger than any memory.
fn too_many() -> Tries {
    counts(&[1 << 60, u64::MAX])
}

pub fn camera_project_points(w: &World) -> Call {
    Call::new("vg_camera_project_points", invoke!(vg_camera_project_points 0 1 2 3 4))
        .argument("camera", Value::Struct(w.camera()))
        .argument("points", Value::Doubles(POINTS.to_vec()))
        .argument("count", Value::Number(2))
        .word("points")
        .tries(too_many())
        .argument("out_pixels", Value::OutDoubles(4))
        .argument("out_depths", Value::OutDoubles(2))
        .nullable()
}

pub fn camera_unproject(w: &World) -> Call {
    let invoke: Invoke = |a, error| unsafe {
        vg_camera_unproject(a[0] as _, a[1] as _, f64::from_bits(a[2] as u64), a[3] as _, error)
    };
    Call::new("vg_camera_unproject", invoke)
        .argument("camera", Value::Struct(w.camera()))
        .argument("pixel", Value::Doubles(vec![10.0, 20.5]))
        .tries(finite())
        .argument("depth_m", Value::Number(4f64.to_bits()))
        .tries([vec![(0, Refused), ((-1f64).to_bits(), Refused)], finite()].concat())
        .argument("out_point", Value::OutDoubles(3))
}

pub fn camera_unproject_points(w: &World) -> Call {
    Call::new("vg_camera_unproject_points", invoke!(vg_camera_unproject_points 0 1 2 3 4))
        .argument("camera", Value::Struct(w.camera()))
        .argument("pixels", Value::Doubles(vec![10.0, 20.5, 30.0, 5.0]))
        .argument("depths", Value::Doubles(vec![4.0, 5.0]))
        .argument("count", Value::Number(2))
        .word("pixels")
        .tries(too_many())
        .argument("out_points", Value::OutDoubles(6))
}

fn figures() -> Lent {
    let fields = fields!(vg_report_figures {
        struct_size: elsewhere(),
        gaussian_count: elsewhere(),
        mirrored_count: elsewhere(),
        views_used: elsewhere(),
        threads: elsewhere(),
        prior: elsewhere(),
        sh_degree: elsewhere(),
        total_ms: elsewhere(),
        peak_rss_bytes: elsewhere(),
        has_input_error: elsewhere(),
        has_box: elsewhere(),
        input_psnr_db: elsewhere(),
        input_silhouette_iou: elsewhere(),
        box_size[3]: elsewhere(),
        extent_low[3]: elsewhere(),
        extent_high[3]: elsewhere(),
        relit_count: elsewhere(),
        cloud_used: elsewhere(),
        photo_found: elsewhere(),
        calibration: elsewhere(),
        has_uncovered: elsewhere(),
        calibration_yaw_degrees: elsewhere(),
        calibration_lateral_m: elsewhere(),
        uncovered_before: elsewhere(),
        uncovered_after: elsewhere(),
        refine_iterations: elsewhere(),
        refine_kept: elsewhere(),
        vehicle_size[3]: elsewhere(),
        vehicle_size_uncertainty[3]: elsewhere(),
        has_vehicle_size: elsewhere(),
        budget_kept: elsewhere(),
        input_mask_covered: elsewhere(),
        input_given_psnr_db: elsewhere(),
        input_given_silhouette_iou: elsewhere(),
        input_given_mask_covered: elsewhere(),
        verdict: elsewhere(),
        reason_count: elsewhere(),
    });
    Lent::zeroed::<vg_report_figures>("vg_report_figures", fields)
}

pub fn report_get_figures(w: &World) -> Call {
    Call::new("vg_report_get_figures", invoke!(vg_report_get_figures 0 1))
        .argument("report", Value::Handle(w.report))
        .argument("out", Value::OutStruct(figures()))
}

pub fn gaussians_load_ply(w: &World) -> Call {
    Call::new("vg_gaussians_load_ply", invoke!(vg_gaussians_load_ply 0 1))
        .argument("path", Value::Text(text(w.scratch.join("few.ply"))))
        .argument("out", Value::OutHandle(Made::Gaussians))
}

pub fn gaussians_save_ply(w: &World) -> Call {
    Call::new("vg_gaussians_save_ply", invoke!(vg_gaussians_save_ply 0 1))
        .argument("gaussians", Value::Handle(w.few))
        .argument("path", Value::Text(text(w.scratch.join("saved.ply"))))
}

fn arrays(count: usize, pointers: [usize; 5], degree: i32) -> Lent {
    let fields = fields!(vg_gaussian_arrays {
        struct_size: elsewhere(),
        count: counts(&[1 << 31, 1 << 60, u64::MAX]),
        positions: elsewhere(),
        scales: elsewhere(),
        rotations: elsewhere(),
        opacities: elsewhere(),
        sh: elsewhere(),
        sh_degree: choice(&[0]),
        flags: reserved(),
    });
    let [positions, scales, rotations, opacities, sh] = pointers.map(|p| p as *const f32);
    let value = vg_gaussian_arrays {
        struct_size: size_of::<vg_gaussian_arrays>(),
        count,
        positions,
        scales,
        rotations,
        opacities,
        sh,
        sh_degree: degree,
        flags: 0,
    };
    Lent::new("vg_gaussian_arrays", &[value], fields)
}

/// Three Gaussians: centres, scales, rotations, opacities, colours.
pub const FEW: [&[f32]; 5] = [
    &[0.0, 0.5, 0.25, 1.0, -0.5, 0.5, -1.0, 0.0, 0.75],
    &[0.1, 0.2, 0.05, 0.3, 0.3, 0.01, 0.02, 0.5, 0.1],
    &[1.0, 0.0, 0.0, 0.0, 0.5, -0.5, 0.5, 0.5, 0.0, 0.0, -3.0, 4.0],
    &[1.0, 0.5, 0.0],
    &[0.2, -0.1, 0.6, 1.0, 0.0, -1.0, 0.3, 0.3, 0.3],
];

pub fn gaussians_from_arrays(_: &World) -> Call {
    let mut memory: Vec<Memory> = FEW.iter().map(|values| Memory::from_values(values, 0)).collect();
    let pointers: Vec<usize> = memory.iter_mut().map(Memory::pointer).collect();
    Call::new("vg_gaussians_from_arrays", invoke!(vg_gaussians_from_arrays 0 1))
        .argument("arrays", Value::Struct(arrays(3, pointers.try_into().unwrap(), 0)))
        .argument("out", Value::OutHandle(Made::Gaussians))
        .memory(memory)
}

pub fn gaussians_transform(w: &World) -> Call {
    Call::new("vg_gaussians_transform", invoke!(vg_gaussians_transform 0 1 2))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("to_from_vehicle", Value::Doubles(SIMILARITY.to_vec()))
        .tries(finite())
        .argument("out", Value::OutHandle(Made::Gaussians))
}

pub fn gaussians_mirror(w: &World) -> Call {
    Call::new("vg_gaussians_mirror", invoke!(vg_gaussians_mirror 0 1))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("out", Value::OutHandle(Made::Gaussians))
}

pub fn gaussians_merge(w: &World) -> Call {
    Call::new("vg_gaussians_merge", invoke!(vg_gaussians_merge 0 1 2))
        .argument("first", Value::Handle(w.gaussians))
        .argument("second", Value::Handle(w.few))
        .argument("out", Value::OutHandle(Made::Gaussians))
}

pub fn gaussians_select(w: &World) -> Call {
    let mut indices = Memory::from_values(&[2usize, 0, 2, 1], 0);
    Call::new("vg_gaussians_select", invoke!(vg_gaussians_select 0 1 2 3))
        .argument("gaussians", Value::Handle(w.few))
        .argument("indices", Value::Handle(indices.pointer()))
        .argument("index_count", Value::Number(4))
        .word("indices")
        .tries(too_many())
        .argument("out", Value::OutHandle(Made::Gaussians))
        .memory(vec![indices])
}

pub fn gaussians_mask(w: &World) -> Call {
    let mut keep = Memory::from_values(&[1u8, 0, 255], 0);
    Call::new("vg_gaussians_mask", invoke!(vg_gaussians_mask 0 1 2 3))
        .argument("gaussians", Value::Handle(w.few))
        .argument("keep", Value::Handle(keep.pointer()))
        .argument("keep_count", Value::Number(3))
        .tries(counts(&[0, 2, 4, 1 << 60, u64::MAX]))
        .argument("out", Value::OutHandle(Made::Gaussians))
        .memory(vec![keep])
}

pub fn gaussians_crop(w: &World) -> Call {
    let infinite = |v: f64| vec![(v.to_bits(), Fine), (f64::NAN.to_bits(), Refused)];
    Call::new("vg_gaussians_crop", invoke!(vg_gaussians_crop 0 1 2 3))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("low", Value::Doubles(vec![-1.0, -0.5, -0.25]))
        .tries([infinite(f64::NEG_INFINITY), vec![(2f64.to_bits(), Refused)]].concat())
        .argument("high", Value::Doubles(vec![1.0, 0.5, 1.0]))
        .word("low")
        .tries([infinite(f64::INFINITY), vec![((-2f64).to_bits(), Refused)]].concat())
        .argument("out", Value::OutHandle(Made::Gaussians))
}

pub fn gaussians_covariances(w: &World) -> Call {
    let mut out = blank(1, 3 * 6 * 4, 3 * 6 * 4, 1, true);
    let mut call = Call::new("vg_gaussians_covariances", invoke!(vg_gaussians_covariances 0 1 2))
        .argument("gaussians", Value::Handle(w.few))
        .argument("out", Value::Handle(out.memory.pointer()))
        .argument("count", Value::Number(3))
        .tries(counts(&[0, 2, 4, 1 << 60, u64::MAX]));
    call.targets = vec![out];
    call
}

/// The file of `few`.
fn few_ply(w: &World) -> Vec<u8> {
    std::fs::read(w.scratch.join("few.ply")).expect("saved with the world")
}

pub fn gaussians_load_ply_memory(w: &World) -> Call {
    let bytes = few_ply(w);
    let mut data = Memory::from_values(&bytes, 1);
    Call::new("vg_gaussians_load_ply_memory", invoke!(vg_gaussians_load_ply_memory 0 1 2))
        .argument("data", Value::Handle(data.pointer()))
        .argument("size", Value::Number(bytes.len() as u64))
        .word("data")
        .tries(counts(&[1 << 63, u64::MAX]))
        .argument("out", Value::OutHandle(Made::Gaussians))
        .memory(vec![data])
}

pub fn gaussians_save_ply_memory(w: &World) -> Call {
    let size = few_ply(w).len();
    let mut buffer = blank(1, size, size, 1, false);
    let mut call = Call::new("vg_gaussians_save_ply_memory", invoke!(vg_gaussians_save_ply_memory 0 1 2))
        .argument("gaussians", Value::Handle(w.few))
        .argument("buffer", Value::Handle(buffer.memory.pointer()))
        .argument("size", Value::Number(size as u64))
        .tries(counts(&[0, 1, size as u64 - 1]));
    call.targets = vec![buffer];
    call
}

fn refine_options(context: usize) -> Lent {
    let fields = fields!(vg_refine_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        seconds: refine_seconds(),
        iterations: [counts(&[1_000_001, u64::from(u32::MAX)]), vec![(0, Fine), (2, Fine)]].concat(),
        hold_out: choice(&[0, 1]),
        densify: choice(&[0, 1]),
        backend: choice_without(&[0, 1], 2),
        progress: elsewhere(),
        progress_user: elsewhere(),
        flags: reserved(),
    });
    let mut lent = Lent::zeroed::<vg_refine_options>("vg_refine_options", fields);
    lent.put("context", 0, context as u64);
    lent.put("iterations", 0, 1);
    lent
}

fn refinement() -> Lent {
    let fields = fields!(vg_refinement {
        struct_size: elsewhere(),
        iterations: elsewhere(),
        made: elsewhere(),
        kept: elsewhere(),
        stop: elsewhere(),
        psnr_before_db: elsewhere(),
        psnr_after_db: elsewhere(),
        held_out_before_db: elsewhere(),
        held_out_after_db: elsewhere(),
    });
    Lent::zeroed::<vg_refinement>("vg_refinement", fields)
}

pub fn refine(w: &World) -> Call {
    let (views, memory) = w.views();
    Call::new("vg_refine", invoke!(vg_refine 0 1 2 3 4 5))
        .argument("gaussians", Value::Handle(w.few))
        .argument("views", Value::Struct(views))
        .argument("view_count", Value::Number(4))
        .tries(counts(&[0, 4097, 1 << 60, u64::MAX]))
        .argument("options", Value::Struct(refine_options(w.context)))
        .nullable()
        .argument("out", Value::OutHandle(Made::Gaussians))
        .argument("out_refinement", Value::OutStruct(refinement()))
        .nullable()
        .memory(memory)
}

fn model_options() -> Lent {
    let fields = fields!(vg_model_options {
        struct_size: elsewhere(),
        runtime: elsewhere(),
        provider: choice(&[0, 1]),
        fall_back: choice(&[0, 1]),
        threads: [counts(&[1025, 1 << 31, u64::from(u32::MAX)]), vec![(1024, Fine)]].concat(),
        prepack: choice(&[0, 1, 2]),
        arena: choice(&[0, 1]),
        flags: reserved(),
    });
    Lent::zeroed::<vg_model_options>("vg_model_options", fields)
}

/// A missing file: errors of arguments take precedence.
pub fn model_open(w: &World) -> Call {
    let mut call = Call::new("vg_model_open", invoke!(vg_model_open 0 1 2))
        .argument("path", Value::Text(text(w.scratch.join("no.onnx"))))
        .argument("options", Value::Struct(model_options()))
        .nullable()
        .argument("out", Value::OutHandle(Made::Model));
    call.good = if vg::onnx::is_built() { vg_status::Io } else { vg_status::NotBuilt };
    call
}

/// The last one, a network, has no model in builds with networks: the error names `options.prior_model`.
fn priors() -> Tries {
    match vg::onnx::is_built() {
        true => [choice(&[0, 1, 2, 4]), counts(&[3])].concat(),
        false => choice_without(&[0, 1, 2, 4], 3),
    }
}

/// Options that C has from the library's table.
fn table() -> Vec<TableField> {
    Options::fields().into_iter().filter(|option| !option.facts.apart.contains(&Face::C)).collect()
}

/// The default of an option as C has it.
fn bits_of(option: &TableField) -> u64 {
    let number_of = |name: &str, e: fn() -> Enumeration| {
        e().variants.iter().find(|variant| variant.name == name).expect("a variant").number as u64
    };
    match (&option.default, option.kind) {
        (OptionValue::Flag(yes), _) => u64::from(*yes),
        (OptionValue::Whole(number), _) => *number,
        (OptionValue::Real(number), _) => number.to_bits(),
        (OptionValue::Name(name), Kind::Choice(e)) => number_of(name, e),
        (OptionValue::Names(names), Kind::Set(e)) => names.iter().map(|name| number_of(name, e)).sum(),
        _ => 0,
    }
}

/// Options of the table that are not named here: what their kind and range allow, where the golden layout has them.
fn newer_options(known: &[Field]) -> Vec<Field> {
    let layout = filled("vg_options");
    let newer = table().into_iter().filter(|option| known.iter().all(|field| field.name != option.name));
    newer
        .map(|option| {
            let numbers =
                |e: fn() -> Enumeration| e().variants.iter().map(|v| v.number).collect::<Vec<i32>>();
            let tries = match option.kind {
                Kind::Flag => choice(&[0, 1]),
                Kind::Choice(e) => choice(&numbers(e)),
                Kind::Set(e) => {
                    vec![(numbers(e).iter().sum::<i32>() as u64, Fine), (u64::from(u32::MAX), Refused)]
                }
                Kind::Whole | Kind::MaybeWhole => vec![(bits_of(&option), Fine)],
                Kind::Real | Kind::MaybeReal => vec![(bits_of(&option), Fine), (f64::NAN.to_bits(), Refused)],
            };
            let place = layout.iter().find(|field| field.name == option.name).expect("a field of vg_options");
            Field { tries, ..place.clone() }
        })
        .collect()
}

fn options(context: usize) -> Lent {
    let fields = fields!(vg_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        prior: priors(),
        symmetry: choice(&[0, 1, 2, 3]),
        sh_degree: choice(&[0, 1, 2, 3]),
        keep: vec![(31, Fine), (32, Refused), (u64::from(u32::MAX), Refused)],
        check: choice(&[0, 1]),
        points: choice(&[0, 1]),
        vehicle_size[3]: within64(0.1, 30.0),
        progress: elsewhere(),
        progress_user: elsewhere(),
        log: elsewhere(),
        log_user: elsewhere(),
        calibrate: choice(&[0, 1]),
        relight: choice(&[0, 1]),
        photo: choice(&[0, 1]),
        flags: reserved(),
        budget_s: budget(),
        cloud: elsewhere(),
        cloud_count: counts(&[10_000_001, 1 << 60, u64::MAX]),
        resolution: share(),
        max_views: [0, 1, 4097, 1 << 60, u64::MAX].map(|n| (n, Fine)).to_vec(),
        prior_model: elsewhere(),
        head_model: elsewhere(),
        refine_seconds: refine_seconds(),
        refine_iterations: vec![(0, Fine), (2, Fine), (1_000_001, Refused), (u64::from(u32::MAX), Refused)],
        refine_hold_out: choice(&[0, 1]),
        refine_backend: choice_without(&[0, 1], 2),
        refine_flags: reserved(),
        vehicle_center[3]: elsewhere(),
        vehicle_yaw: elsewhere(),
        has_vehicle_place: choice(&[0, 1]),
        vehicle_flags: reserved(),
        progress_overall: elsewhere(),
        max_gaussians: [0, 100_000, 1 << 60, u64::MAX].map(|n| (n, Fine)).to_vec(),
    });
    let newer = newer_options(&fields);
    let mut lent = Lent::zeroed::<vg_options>("vg_options", [fields, newer].concat());
    lent.put("context", 0, context as u64);
    for option in table() {
        // Any number of Gaussians.
        if option.name != "max_gaussians" {
            lent.put(option.name, 0, bits_of(&option));
        }
    }
    for (i, metres) in [4.4f64, 1.8, 1.4].into_iter().enumerate() {
        lent.put("vehicle_size", i, metres.to_bits());
    }
    lent
}

pub fn reconstruct(w: &World) -> Call {
    let (views, memory) = w.views();
    Call::new("vg_reconstruct", invoke!(vg_reconstruct 0 1 2 3 4))
        .argument("views", Value::Struct(views))
        .argument("view_count", Value::Number(4))
        .tries(counts(&[0, 4097, 1 << 60, usize::MAX as u64]))
        .argument("options", Value::Struct(options(w.context)))
        .nullable()
        .argument("out_gaussians", Value::OutHandle(Made::Gaussians))
        .argument("out_report", Value::OutHandle(Made::Report))
        .nullable()
        .memory(memory)
}

fn render_options(context: usize) -> Lent {
    let fields = fields!(vg_render_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        backend: choice_without(&[0, 1], 2),
        background: choice(&[0, 1]),
        background_color[3]: within32(0.0, 1.0),
        alpha: choice(&[0, 1]),
        depth_mode: choice(&[0, 1]),
        sh_degree: choice(&[0, 1, 2, 3]),
        antialiased: choice(&[0, 1]),
        blur: within32(1e-4, 100.0),
        near_plane: within32(1e-6, 1e10),
        far_plane: within32(0.01, 1e10),
        max_alpha: within32(0.01, 0.9999),
        flags: reserved(),
        progress: elsewhere(),
        progress_user: elsewhere(),
    });
    let mut lent = Lent::zeroed::<vg_render_options>("vg_render_options", fields);
    lent.put("context", 0, context as u64);
    lent.put("sh_degree", 0, 3);
    for (name, value) in [("blur", 0.3f32), ("near_plane", 0.01), ("far_plane", 1e10), ("max_alpha", 0.99)] {
        lent.put(name, 0, u64::from(value.to_bits()));
    }
    lent
}

/// Colour, depth, alpha: address and stride.
fn target(planes: [(usize, usize); 3]) -> Lent {
    let overflowing = [1, 47, usize::MAX as u64, usize::MAX as u64 / 2, (isize::MAX / 35) as u64];
    let fields = fields!(vg_image_target {
        struct_size: elsewhere(),
        width as "target.size": counts(&[0, 47, 49, 8193, u64::from(u32::MAX)]),
        height as "target.size": counts(&[0, 35, 37, 8193, u64::from(u32::MAX)]),
        color: elsewhere(),
        color_row_stride: counts(&overflowing),
        depth: elsewhere(),
        depth_row_stride: counts(&overflowing),
        color_format: choice(&[]),
        flags: reserved(),
        alpha: elsewhere(),
        alpha_row_stride: counts(&overflowing),
    });
    let [color, depth, alpha] = planes;
    let value = vg_image_target {
        struct_size: size_of::<vg_image_target>(),
        width: WIDTH,
        height: HEIGHT,
        color: color.0 as _,
        color_row_stride: color.1,
        depth: depth.0 as _,
        depth_row_stride: depth.1,
        color_format: vg_format::Rgba8 as i32,
        flags: 0,
        alpha: alpha.0 as _,
        alpha_row_stride: alpha.1,
    };
    Lent::new("vg_image_target", &[value], fields)
}

/// A picture of the world's size, without memory between the first byte and the last byte of its last pixel, with gaps.
pub fn blank(height: u32, row: usize, stride: usize, shift: usize, is_float: bool) -> Target {
    let memory = Memory::new(&vec![CANARY; (height as usize - 1) * stride + row], shift);
    Target { memory, row, stride, is_float }
}

pub fn render(w: &World) -> Call {
    render_as(w, "vg_render", w.camera())
}

/// `vg_render` with a distorted camera, which takes another path through the renderer.
pub fn render_through_a_lens(w: &World) -> Call {
    let mut camera = w.camera();
    camera.put("model", 0, vg_camera_model::Opencv as u64);
    for (i, k) in [-0.1f64, 0.01, 1e-3, -1e-3].into_iter().enumerate() {
        camera.put("params", 4 + i, k.to_bits());
    }
    let at = camera.fields.iter().position(|f| f.name == "model").unwrap();
    camera.fields[at].tries = choice(&[4]);
    render_as(w, "vg_render", camera)
}

fn render_as(w: &World, function: &'static str, camera: Lent) -> Call {
    let (lent, targets) = pictures();
    let mut call = Call::new(function, invoke!(vg_render 0 1 2 3))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("camera", Value::Struct(camera))
        .argument("options", Value::Struct(render_options(w.context)))
        .nullable()
        .argument("target", Value::Struct(lent));
    call.targets = targets;
    call
}

fn renderer_options(context: usize) -> Lent {
    let fields = fields!(vg_renderer_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        backend: choice_without(&[0, 1], 2),
        flags: reserved(),
    });
    let mut lent = Lent::zeroed::<vg_renderer_options>("vg_renderer_options", fields);
    lent.put("context", 0, context as u64);
    lent
}

pub fn renderer_new(w: &World) -> Call {
    Call::new("vg_renderer_new", invoke!(vg_renderer_new 0 1 2))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("options", Value::Struct(renderer_options(w.context)))
        .nullable()
        .argument("out", Value::OutHandle(Made::Renderer))
}

pub fn renderer_render(w: &World) -> Call {
    let (mut lent, targets) = pictures();
    let mut cameras = w.camera();
    // Arrays of one element each.
    (lent.is_array, cameras.is_array) = (true, true);
    for field in &mut lent.fields {
        field.word = field.word.replace("target.size", "size");
    }
    let mut call = Call::new("vg_renderer_render", invoke!(vg_renderer_render 0 1 2 3 4))
        .argument("renderer", Value::Handle(w.renderer))
        .argument("cameras", Value::Struct(cameras))
        .argument("count", Value::Number(1))
        .tries(counts(&[0, 4097, 1 << 60, usize::MAX as u64]))
        .argument("options", Value::Struct(render_options(w.context)))
        .nullable()
        .argument("targets", Value::Struct(lent));
    call.targets = targets;
    call
}

/// Colour, depth and alpha with gaps between rows, at odd addresses.
fn pictures() -> (Lent, Vec<Target>) {
    let row = WIDTH as usize * 4;
    let mut targets = vec![
        blank(HEIGHT, row, row + 5, 1, false),
        blank(HEIGHT, row, row + 3, 2, true),
        blank(HEIGHT, row, row + 1, 3, true),
    ];
    let planes: Vec<_> = targets.iter_mut().map(|t| (t.memory.pointer(), t.stride)).collect();
    (target([planes[0], planes[1], planes[2]]), targets)
}

/// Row strides in bytes of the planes of a gradient: colour without gaps, alpha and depth with gaps.
pub const GRADIENT_STRIDES: [usize; 3] = [0, 4 * WIDTH as usize + 1, 4 * WIDTH as usize + 4];

/// Gradients of colour, alpha and depth.
fn image_gradient(planes: [usize; 3]) -> Lent {
    let overflowing = [1, 47, 191, usize::MAX as u64, usize::MAX as u64 / 2, (isize::MAX / 35) as u64];
    let fields = fields!(vg_image_gradient {
        struct_size: elsewhere(),
        width as "size": counts(&[0, 47, 49, 8193, u64::from(u32::MAX)]),
        height as "size": counts(&[0, 35, 37, 8193, u64::from(u32::MAX)]),
        color: elsewhere(),
        color_row_stride: counts(&overflowing),
        alpha: elsewhere(),
        alpha_row_stride: counts(&overflowing),
        depth: elsewhere(),
        depth_row_stride: counts(&overflowing),
        loss: elsewhere(),
        loss_user: elsewhere(),
        flags: vec![(0, Fine), (1, Refused), (1 << 63, Refused)],
    });
    let value = vg_image_gradient {
        struct_size: size_of::<vg_image_gradient>(),
        width: WIDTH,
        height: HEIGHT,
        color: planes[0] as _,
        color_row_stride: GRADIENT_STRIDES[0],
        alpha: planes[1] as _,
        alpha_row_stride: GRADIENT_STRIDES[1],
        depth: planes[2] as _,
        depth_row_stride: GRADIENT_STRIDES[2],
        loss: None,
        loss_user: null_mut(),
        flags: 0,
    };
    Lent::new("vg_image_gradient", &[value], fields)
}

/// Positions, scales, rotations, opacities, sh, background, pose, view matrix.
fn gradients(count: usize, degree: i32, arrays: [usize; 8]) -> Lent {
    let fields = fields!(vg_gradients {
        struct_size: elsewhere(),
        count: counts(&[0, 1, 1 << 31, 1 << 60, u64::MAX]),
        positions: elsewhere(),
        scales: elsewhere(),
        rotations: elsewhere(),
        opacities: elsewhere(),
        sh: elsewhere(),
        background: elsewhere(),
        pose: elsewhere(),
        view_matrix: elsewhere(),
        sh_degree: counts(&[0, 1, 3, 4, 77, u64::from(u32::MAX)]),
        flags: reserved(),
    });
    let value = vg_gradients {
        struct_size: size_of::<vg_gradients>(),
        count,
        positions: arrays[0] as _,
        scales: arrays[1] as _,
        rotations: arrays[2] as _,
        opacities: arrays[3] as _,
        sh: arrays[4] as _,
        background: arrays[5] as _,
        pose: arrays[6] as _,
        view_matrix: arrays[7] as _,
        sh_degree: degree,
        flags: 0,
    };
    Lent::new("vg_gradients", &[value], fields)
}

/// Numbers of both signs, with a period that divides no side of the picture.
pub fn noise(n: usize) -> Vec<f32> {
    (0..n).map(|i| ((i * 7919) % 1009) as f32 / 1009.0 - 0.5).collect()
}

/// A backward call without a picture.
pub fn render_backward(w: &World) -> Call {
    backward_as(w, w.camera(), false)
}

/// A backward call with a distorted camera, which takes another path through the renderer.
pub fn render_backward_through_a_lens(w: &World) -> Call {
    let mut straight = render_through_a_lens(w);
    let camera = straight.lent("camera").clone();
    backward_as(w, camera, false)
}

/// A backward call that also returns the picture.
pub fn render_backward_with_a_picture(w: &World) -> Call {
    backward_as(w, w.camera(), true)
}

fn backward_as(w: &World, camera: Lent, has_picture: bool) -> Call {
    let pixels = (WIDTH * HEIGHT) as usize;
    let row = WIDTH as usize * 4;
    let (color, plane) = (noise(3 * pixels), noise(pixels));
    let mut memory = vec![
        Memory::from_values(&color, 1),
        Memory::new(&spread(bytes_of(&plane), row, GRADIENT_STRIDES[1], 0), 2),
        Memory::new(&spread(bytes_of(&plane), row, GRADIENT_STRIDES[2], 0), 3),
    ];
    let planes: Vec<usize> = memory.iter_mut().map(Memory::pointer).collect();
    let (n, degree) =
        unsafe { (vg_gaussians_count(w.gaussians as _), vg_gaussians_sh_degree(w.gaussians as _)) };
    let sh = 3 * (degree as usize + 1).pow(2);
    // Each array is one row of a picture, at its own address.
    let mut arrays: Vec<Target> = [12 * n, 12 * n, 16 * n, 4 * n, 4 * sh * n, 24, 48, 128]
        .iter()
        .enumerate()
        .map(|(i, &bytes)| blank(1, bytes, bytes, i % 5, i < 5))
        .collect();
    let addresses: Vec<usize> = arrays.iter_mut().map(|array| array.memory.pointer()).collect();
    let out = gradients(n, degree, addresses.try_into().expect("eight arrays"));
    let (picture, targets) = pictures();
    let target = if has_picture { Value::Struct(picture) } else { Value::Null };
    let mut call = Call::new("vg_render_backward", invoke!(vg_render_backward 0 1 2 3 4 5))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("camera", Value::Struct(camera))
        .argument("options", Value::Struct(render_options(w.context)))
        .nullable()
        .argument("target", target)
        .nullable()
        .argument("gradient", Value::Struct(image_gradient([planes[0], planes[1], planes[2]])))
        .argument("out", Value::Struct(out))
        .memory(memory);
    // On a transparent background, the gradient of colour refers to premultiplied colour.
    call.lent("options").put("alpha", 0, vg_alpha::Premultiplied as u64);
    call.targets = arrays;
    if has_picture {
        call.targets.extend(targets);
    }
    call
}

fn segment_options(context: usize) -> Lent {
    let fields = fields!(vg_segment_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        flags: vec![(0, Fine), (1, Refused), (1 << 63, Refused)],
    });
    let mut lent = Lent::zeroed::<vg_segment_options>("vg_segment_options", fields);
    lent.put("context", 0, context as u64);
    lent
}

/// Without a model; the error of that comes last. The picture is at an odd address.
pub fn segment(w: &World) -> Call {
    let mut memory = Vec::new();
    let view = w.photographs[0].view(0, &mut memory);
    memory.push(Memory::from_values(&[view.image], 3));
    let image = memory.last_mut().expect("a picture").pointer();
    let stride = WIDTH as usize + 5;
    let mut mask = blank(HEIGHT, WIDTH as usize, stride, 1, false);
    let mut call = Call::new("vg_segment", invoke!(vg_segment 0 1 2 3 4 5))
        .argument("model", Value::Null)
        .nullable()
        .argument("image", Value::Handle(image))
        .argument("camera", Value::Struct(w.camera()))
        .argument("options", Value::Struct(segment_options(w.context)))
        .nullable()
        .argument("out_mask", Value::Handle(mask.memory.pointer()))
        .argument("row_stride", Value::Number(stride as u64))
        .tries(counts(&[1, 47, usize::MAX as u64, usize::MAX as u64 / 2]))
        .memory(memory);
    call.targets = vec![mask];
    call.good = if vg::onnx::is_built() { vg_status::Argument } else { vg_status::NotBuilt };
    call
}

fn metrics_options(context: usize) -> Lent {
    let fields = fields!(vg_metrics_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        lpips: elsewhere(),
        f_score_m: within64(1e-3, 1e3),
        flags: vec![(0, Fine), (1, Refused), (1 << 63, Refused)],
        progress: elsewhere(),
        progress_user: elsewhere(),
    });
    let mut lent = Lent::zeroed::<vg_metrics_options>("vg_metrics_options", fields);
    lent.put("context", 0, context as u64);
    lent.put("f_score_m", 0, 0.05f64.to_bits());
    lent
}

/// The fields of a struct in the golden layout, which a call fills.
fn filled(of: &str) -> Vec<Field> {
    let layout = std::fs::read_to_string(golden().join("layout_x86_64.txt")).unwrap();
    let lines = layout.lines().filter_map(|line| line.strip_prefix(of)?.strip_prefix('.'));
    let field = |line: &str| {
        let (name, place) = line.split_once(" at ")?;
        let (offset, size) = place.split_once(" size ")?;
        let (offset, size) = (offset.parse().ok()?, size.parse().ok()?);
        Some(Field { name: name.into(), word: name.into(), offset, size, count: 1, tries: elsewhere() })
    };
    lines.filter_map(field).collect()
}

fn picture_errors() -> Lent {
    Lent::zeroed::<vg_picture_errors>("vg_picture_errors", filled("vg_picture_errors"))
}

fn view_errors() -> Lent {
    Lent::zeroed::<vg_view_errors>("vg_view_errors", filled("vg_view_errors"))
}

fn surface_errors() -> Lent {
    Lent::zeroed::<vg_surface_errors>("vg_surface_errors", filled("vg_surface_errors"))
}

/// Two photographs, one with gaps between its rows and one with alpha, at odd addresses.
pub fn metrics_pictures(w: &World) -> Call {
    let mut memory = Vec::new();
    let mut picture = |i: usize| {
        let view = w.photographs[i].view(i, &mut memory);
        memory.push(Memory::from_values(&[view.image], 3));
        memory.last_mut().expect("a picture").pointer()
    };
    let (a, b) = (picture(0), picture(2));
    Call::new("vg_metrics_pictures", invoke!(vg_metrics_pictures 0 1 2 3))
        .argument("a", Value::Handle(a))
        .argument("b", Value::Handle(b))
        .argument("options", Value::Struct(metrics_options(w.context)))
        .nullable()
        .argument("out", Value::OutStruct(picture_errors()))
        .memory(memory)
}

pub fn metrics_view(w: &World) -> Call {
    let mut memory = Vec::new();
    let view = w.photographs[0].view(0, &mut memory);
    Call::new("vg_metrics_view", invoke!(vg_metrics_view 0 1 2 3))
        .argument("gaussians", Value::Handle(w.few))
        .argument("view", Value::Struct(Lent::new("vg_view", &[view], view_fields())))
        .argument("options", Value::Struct(metrics_options(w.context)))
        .nullable()
        .argument("out", Value::OutStruct(view_errors()))
        .memory(memory)
}

/// Arbitrary points; whether they fit the model is not checked.
pub fn metrics_surface(w: &World) -> Call {
    let points: Vec<f32> = (0..3 * SCAN_POINTS).map(|i| (i as f32).sin()).collect();
    let mut points = Memory::from_values(&points, 0);
    Call::new("vg_metrics_surface", invoke!(vg_metrics_surface 0 1 2 3 4))
        .argument("gaussians", Value::Handle(w.gaussians))
        .argument("points", Value::Handle(points.pointer()))
        .argument("point_count", Value::Number(SCAN_POINTS as u64))
        .tries(counts(&[0, 10_000_001, 1 << 60, u64::MAX]))
        .argument("options", Value::Struct(metrics_options(w.context)))
        .nullable()
        .argument("out", Value::OutStruct(surface_errors()))
        .memory(vec![points])
}

const SCAN_POINTS: usize = 20;

fn align_options(context: usize) -> Lent {
    let fields = fields!(vg_align_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        heading: choice(&[0, 1, 2]),
        flags: reserved(),
        progress: elsewhere(),
        progress_user: elsewhere(),
    });
    let mut lent = Lent::zeroed::<vg_align_options>("vg_align_options", fields);
    lent.put("context", 0, context as u64);
    lent
}

fn alignment() -> Lent {
    let fields = fields!(vg_alignment {
        struct_size: elsewhere(),
        vehicle_from_world[16]: elsewhere(),
        scale: elsewhere(),
        residual_m: elsewhere(),
        confidence: elsewhere(),
        residual_px: elsewhere(),
        other_px: elsewhere(),
        used_count: elsewhere(),
    });
    Lent::zeroed::<vg_alignment>("vg_alignment", fields)
}

/// Arbitrary points.
fn anywhere() -> Vec<f64> {
    (0..3 * SCAN_POINTS).map(|i| (i as f64).sin()).collect()
}

/// Views whose cameras and masks are read.
fn masked_views(w: &World) -> (Lent, Vec<Memory>) {
    let (mut views, memory) = w.views();
    views.fields.retain(|field| !field.name.starts_with("image") && !field.name.starts_with("depth"));
    (views, memory)
}

/// With a scan that has no surface; the error of that comes last.
pub fn align_scan(w: &World) -> Call {
    let (views, mut memory) = masked_views(w);
    let mut sparse = Memory::from_values(&anywhere(), 0);
    let mut scan = Memory::from_values(&anywhere().iter().map(|v| *v as f32).collect::<Vec<f32>>(), 0);
    let (world, points) = (sparse.pointer(), scan.pointer());
    memory.extend([sparse, scan]);
    let mut call = Call::new("vg_align_scan", invoke!(vg_align_scan 0 1 2 3 4 5 6 7))
        .argument("views", Value::Struct(views))
        .argument("view_count", Value::Number(4))
        .tries(counts(&[0, 4097, 1 << 60, u64::MAX]))
        .argument("sparse", Value::Handle(world))
        .argument("sparse_count", Value::Number(SCAN_POINTS as u64))
        .tries(counts(&[10_000_001, 1 << 60, u64::MAX]))
        .argument("scan", Value::Handle(points))
        .argument("scan_count", Value::Number(SCAN_POINTS as u64))
        .tries(counts(&[0, 10_000_001, 1 << 60, u64::MAX]))
        .argument("options", Value::Struct(align_options(w.context)))
        .nullable()
        .argument("out", Value::OutStruct(alignment()))
        .memory(memory);
    call.good = vg_status::Argument;
    call
}

/// With points that have no ground; the error of that comes last.
pub fn align_box(w: &World) -> Call {
    let (views, mut memory) = masked_views(w);
    let mut sparse = Memory::from_values(&anywhere(), 0);
    let world = sparse.pointer();
    memory.push(sparse);
    let mut call = Call::new("vg_align_box", invoke!(vg_align_box 0 1 2 3 4 5 6))
        .argument("views", Value::Struct(views))
        .argument("view_count", Value::Number(4))
        .tries(counts(&[0, 4097, 1 << 60, u64::MAX]))
        .argument("sparse", Value::Handle(world))
        .argument("sparse_count", Value::Number(SCAN_POINTS as u64))
        .tries(counts(&[10_000_001, 1 << 60, u64::MAX]))
        .argument("size", Value::Doubles(vec![4.5, 1.8, 1.5]))
        .tries(within64(0.2, 30.0))
        .argument("options", Value::Struct(align_options(w.context)))
        .argument("out", Value::OutStruct(alignment()))
        .memory(memory);
    call.good = vg_status::Argument;
    call
}

pub fn align_points(_: &World) -> Call {
    let (world, count) = (anywhere(), SCAN_POINTS as u32);
    let vehicle = world.iter().map(|v| 3.0 * v + 1.0).collect();
    let mut kept = blank(1, SCAN_POINTS, SCAN_POINTS, 1, false);
    let mut call = Call::new("vg_align_points", invoke!(vg_align_points 0 1 2 3 4 5))
        .argument("world", Value::Doubles(world))
        .tries(finite())
        .argument("vehicle", Value::Doubles(vehicle))
        .tries(finite())
        .argument("count", Value::Number(u64::from(count)))
        .tries(counts(&[0, 1, 2, 10_000_001, 1 << 60, u64::MAX]))
        .argument("out", Value::OutStruct(alignment()))
        .argument("out_kept", Value::Handle(kept.memory.pointer()))
        .nullable()
        .argument("out_residuals", Value::OutDoubles(SCAN_POINTS))
        .nullable();
    call.targets = vec![kept];
    call
}

/// With a file of three points; the error of that comes last.
pub fn align_folder(w: &World) -> Call {
    let mut call = Call::new("vg_align_folder", invoke!(vg_align_folder 0 1 2 3))
        .argument("path", Value::Text(text(&w.sample)))
        .argument("scan_path", Value::Text(text(w.scratch.join("few.ply"))))
        .nullable()
        .argument("options", Value::Struct(align_options(w.context)))
        .nullable()
        .argument("out", Value::OutStruct(alignment()));
    call.good = vg_status::Argument;
    call
}

fn scene_options(context: usize) -> Lent {
    let fields = fields!(vg_scene_options {
        struct_size: elsewhere(),
        context: elsewhere(),
        vehicle_from_world: elsewhere(),
        names: elsewhere(),
        name_count: counts(&[0, 4097, 1 << 60, u64::MAX]),
        depth_scale: [finite(), vec![((-1.0f64).to_bits(), Refused), (1e-3f64.to_bits(), Fine)]].concat(),
        load_depth: choice(&[0, 1]),
        flags: reserved(),
        log: elsewhere(),
        log_user: elsewhere(),
        progress: elsewhere(),
        progress_user: elsewhere(),
    });
    let mut lent = Lent::zeroed::<vg_scene_options>("vg_scene_options", fields);
    lent.put("context", 0, context as u64);
    lent.put("load_depth", 0, 1);
    lent
}

/// Two views by name, one with its extension, one without.
fn names() -> Vec<Memory> {
    let mut names = vec![Memory::new(b"001\0", 0), Memory::new(b"000.png\0", 0)];
    let pointers: Vec<usize> = names.iter_mut().map(Memory::pointer).collect();
    names.push(Memory::from_values(&pointers, 0));
    names
}

fn open(w: &World, function: &'static str, invoke: Invoke, path: &Path) -> Call {
    let (mut memory, mut options) = (names(), scene_options(w.context));
    options.put("names", 0, memory[2].pointer() as u64);
    options.put("name_count", 0, 2);
    memory.push(Memory::from_values(&SIMILARITY, 4));
    options.put("vehicle_from_world", 0, memory[3].pointer() as u64);
    Call::new(function, invoke)
        .argument("path", Value::Text(text(path)))
        .argument("options", Value::Struct(options))
        .argument("out", Value::OutHandle(Made::Scene))
        .memory(memory)
}

pub fn colmap_open(w: &World) -> Call {
    open(w, "vg_colmap_open", invoke!(vg_colmap_open 0 1 2), &w.sample)
}

pub fn transforms_open(w: &World) -> Call {
    let mut call =
        open(w, "vg_transforms_open", invoke!(vg_transforms_open 0 1 2), &w.sample.join("transforms.json"));
    call.arguments[1].nullable = true;
    call
}

pub fn scene_get_view(w: &World) -> Call {
    Call::new("vg_scene_get_view", invoke!(vg_scene_get_view 0 1 2))
        .argument("scene", Value::Handle(w.scene))
        .argument("index", Value::Number(1))
        .tries(counts(&[2, 3, 1 << 40, usize::MAX as u64]))
        .argument("out", Value::OutStruct(Lent::zeroed::<vg_view>("vg_view", view_fields())))
}
