//! Reads arguments (structs that begin with their size, strings, arrays), and writes structs back.

use std::ffi::{CStr, c_char};
use std::path::Path;
use vg::geometry::Choice;
use vg::{Error, Result};

/// A struct of the ABI that may grow.
///
/// # Safety
/// `repr(C)`, no padding, valid for every pattern of bits, and its first field is `struct_size: usize`.
pub(super) unsafe trait Versioned: Copy {
    /// Its name in C.
    const NAME: &'static str;

    /// `sizeof` in the release that introduced the struct; no caller has a shorter one.
    const FIRST_SIZE: usize;

    /// Initial values, as set by the struct's `_init` function.
    fn initial() -> Self;
}

/// Upper limit on the size of any struct; a larger `struct_size` was not initialized.
const MAX_SIZE: usize = 4096;

/// Reads a caller's struct. Fields that an older caller's struct lacks have their initial values; fields that a newer
/// caller's struct has in addition must be zero, because this library does not have their functions.
pub(super) unsafe fn required<T: Versioned>(argument: &str, pointer: *const T) -> Result<T> {
    if pointer.is_null() {
        return Err(Error::argument(argument, "NULL", format!("a {}", T::NAME)));
    }
    let size = unsafe { struct_size(argument, pointer)? };
    unsafe { sized(argument, pointer, size) }
}

/// Reads a caller's struct as [`required`] does; NULL means the initial values.
pub(super) unsafe fn optional<T: Versioned>(argument: &str, pointer: *const T) -> Result<T> {
    if pointer.is_null() { Ok(T::initial()) } else { unsafe { required(argument, pointer) } }
}

/// Reads an array whose elements have the size of the caller's struct.
pub(super) unsafe fn array<T: Versioned>(argument: &str, first: *const T, count: usize) -> Result<Vec<T>> {
    if first.is_null() {
        return Err(Error::argument(argument, "NULL", format!("an array of {}", T::NAME)));
    }
    let stride = unsafe { struct_size(&format!("{argument}[0]"), first)? };
    if !stride.is_multiple_of(align_of::<T>()) {
        let allowed = format!("a multiple of {} in an array", align_of::<T>());
        return Err(Error::argument(format!("{argument}[0].struct_size"), stride.to_string(), allowed));
    }
    let mut elements = Vec::with_capacity(count);
    for i in 0..count {
        let element = unsafe { first.byte_add(i * stride) };
        let name = format!("{argument}[{i}]");
        let size = unsafe { struct_size(&name, element)? };
        if size != stride {
            let allowed = format!("{stride}, as in {argument}[0]");
            return Err(Error::argument(format!("{name}.struct_size"), size.to_string(), allowed));
        }
        elements.push(unsafe { sized(&name, element, size)? });
    }
    Ok(elements)
}

/// Fills a caller's struct of any accepted length. Its `struct_size` is kept; fields that this library does not know
/// are set to zero.
pub(super) unsafe fn fill<T: Versioned>(argument: &str, target: *mut T, value: &T) -> Result<()> {
    if target.is_null() {
        return Err(Error::argument(argument, "NULL", format!("a {}", T::NAME)));
    }
    let size = unsafe { struct_size(argument, target)? };
    unsafe { write_sized(target, value, size) };
    Ok(())
}

/// Checks before the work that [`fill`] will accept a caller's struct.
pub(super) unsafe fn fillable<T: Versioned>(argument: &str, target: *const T) -> Result<()> {
    not_null(argument, target, T::NAME)?;
    unsafe { struct_size(argument, target).map(|_| ()) }
}

/// Implements every `_init` function; `size` is the caller's `sizeof`.
pub(super) unsafe fn initialize<T: Versioned>(argument: &str, target: *mut T, size: usize) -> Result<()> {
    if target.is_null() {
        return Err(Error::argument(argument, "NULL", format!("a {}", T::NAME)));
    }
    check_size::<T>("size", size)?;
    unsafe {
        write_sized(target, &T::initial(), size);
        target.cast::<usize>().write_unaligned(size);
    }
    Ok(())
}

unsafe fn struct_size<T: Versioned>(argument: &str, pointer: *const T) -> Result<usize> {
    let size = unsafe { pointer.cast::<usize>().read_unaligned() };
    check_size::<T>(&format!("{argument}.struct_size"), size)?;
    Ok(size)
}

fn check_size<T: Versioned>(argument: &str, size: usize) -> Result<()> {
    if (T::FIRST_SIZE..=MAX_SIZE).contains(&size) {
        return Ok(());
    }
    let allowed = format!("sizeof({}), at least {}", T::NAME, T::FIRST_SIZE);
    Err(Error::argument(argument, size.to_string(), allowed))
}

unsafe fn sized<T: Versioned>(argument: &str, pointer: *const T, size: usize) -> Result<T> {
    let known = size.min(size_of::<T>());
    let mut value = T::initial();
    // Copies bytes, so that the caller's struct need not be aligned.
    unsafe {
        std::ptr::copy_nonoverlapping(pointer.cast::<u8>(), (&raw mut value).cast::<u8>(), known);
        (&raw mut value).cast::<usize>().write(size_of::<T>());
    }
    let beyond = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>().add(known), size - known) };
    if beyond.iter().any(|&byte| byte != 0) {
        let found = format!("{size} bytes, some of which after the first {known} are not zero");
        let allowed = format!(
            "only zeros after the {known} bytes that version {} of the library knows",
            env!("CARGO_PKG_VERSION")
        );
        return Err(Error::argument(argument, found, allowed));
    }
    Ok(value)
}

unsafe fn write_sized<T: Versioned>(target: *mut T, value: &T, size: usize) {
    const SKIP: usize = size_of::<usize>();
    let known = size.min(size_of::<T>());
    unsafe {
        let (from, to) = (std::ptr::from_ref(value).cast::<u8>(), target.cast::<u8>());
        std::ptr::copy_nonoverlapping(from.add(SKIP), to.add(SKIP), known - SKIP);
        to.add(known).write_bytes(0, size - known);
    }
}

/// Checks that a handle or out parameter is not NULL.
pub(super) fn not_null<T>(argument: &str, pointer: *const T, what: &str) -> Result<()> {
    if pointer.is_null() {
        return Err(Error::argument(argument, "NULL", what));
    }
    Ok(())
}

/// A reference to the object that a handle points to.
pub(super) unsafe fn handle<'a, T>(argument: &str, pointer: *const T, what: &str) -> Result<&'a T> {
    unsafe { pointer.as_ref() }.ok_or_else(|| Error::argument(argument, "NULL", what))
}

/// A NUL-terminated UTF-8 string; `""` for NULL.
pub(super) unsafe fn text<'a>(argument: &str, pointer: *const c_char) -> Result<&'a str> {
    if pointer.is_null() {
        return Ok("");
    }
    let bytes = unsafe { CStr::from_ptr(pointer) };
    bytes
        .to_str()
        .map_err(|_| Error::argument(argument, format!("{:?}", bytes.to_string_lossy()), "a UTF-8 string"))
}

/// A path: NUL-terminated, not empty; any bytes where the system's paths are bytes, else UTF-8.
pub(super) unsafe fn path<'a>(argument: &str, pointer: *const c_char) -> Result<&'a Path> {
    if pointer.is_null() {
        return Err(Error::argument(argument, "NULL", "a path"));
    }
    let bytes = unsafe { CStr::from_ptr(pointer) };
    if bytes.is_empty() {
        return Err(Error::argument(argument, "\"\"", "a path"));
    }
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        Ok(Path::new(std::ffi::OsStr::from_bytes(bytes.to_bytes())))
    }
    #[cfg(not(unix))]
    unsafe {
        text(argument, pointer).map(Path::new)
    }
}

/// `count` numbers of the caller; if `count` is 0, an empty slice for any pointer.
pub(super) unsafe fn numbers<'a, T>(argument: &str, pointer: *const T, count: usize) -> Result<&'a [T]> {
    if count == 0 {
        // `std::vector::data()` of an empty vector may be NULL.
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(Error::argument(argument, "NULL", format!("{count} numbers")));
    }
    if !pointer.is_aligned() {
        let allowed = format!("a multiple of {} bytes", align_of::<T>());
        return Err(Error::argument(argument, format!("address {pointer:p}"), allowed));
    }
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Error::argument(argument, format!("{count} numbers"), "as many as fit into memory"));
    }
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Exactly `N` numbers, at any address.
pub(super) unsafe fn fixed<const N: usize>(argument: &str, pointer: *const f64) -> Result<[f64; N]> {
    if pointer.is_null() {
        return Err(Error::argument(argument, "NULL", format!("{N} numbers")));
    }
    Ok(unsafe { pointer.cast::<[f64; N]>().read_unaligned() })
}

/// Checks an output array of `count` numbers, which may be NULL if `count` is 0.
pub(super) fn writable<T>(argument: &str, pointer: *const T, count: usize) -> Result<()> {
    if count == 0 { Ok(()) } else { not_null(argument, pointer, &format!("{count} elements")) }
}

/// The address of numbers that the caller borrows; NULL if there are none.
pub(super) fn address<T, U>(values: &[T]) -> *const U {
    if values.is_empty() { std::ptr::null() } else { values.as_ptr().cast() }
}

/// The choice with a number, checked.
pub(super) fn choice<T: Choice>(argument: &str, number: i32) -> Result<T> {
    T::from_number(argument, number)
}

/// The value of an enumerator's number, checked, for enumerations that only C has and for parts of others.
pub(super) fn one_of<T: Copy>(argument: &str, number: i32, choices: &[(i32, &str, T)]) -> Result<T> {
    choices.iter().find(|(n, ..)| *n == number).map(|(.., value)| *value).ok_or_else(|| {
        let names: Vec<String> = choices.iter().map(|(n, name, _)| format!("{n} ({name})")).collect();
        Error::argument(argument, number.to_string(), names.join(", "))
    })
}

/// A whole number that is not negative and fits into its type.
pub(super) fn whole<T: TryFrom<i32>>(argument: &str, number: i32, allowed: &str) -> Result<T> {
    T::try_from(number).map_err(|_| Error::argument(argument, number.to_string(), allowed))
}

/// A boolean that is passed as a number.
pub(super) fn flag(argument: &str, number: i32) -> Result<bool> {
    one_of(argument, number, &[(0, "no", false), (1, "yes", true)])
}

/// Renames the argument or field of an error from the library's name, `from`, to C's name, `to`.
pub(super) fn renamed(error: Error, names: &[(&str, &str)]) -> Error {
    let Error::Argument { argument, found, allowed } = error else { return error };
    let known = names.iter().find_map(|(from, to)| {
        let rest = argument.strip_prefix(from)?;
        (rest.is_empty() || rest.starts_with('[')).then(|| format!("{to}{rest}"))
    });
    Error::Argument { argument: known.unwrap_or(argument), found, allowed }
}

/// Checks that a reserved field is zero.
pub(super) fn zero(argument: &str, is_zero: bool) -> Result<()> {
    if is_zero { Ok(()) } else { Err(Error::argument(argument, "not zero", "zero: reserved")) }
}
