//! Names the C library by the number of its binary interface, `libvg.so.0`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let os = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    match os.as_str() {
        "linux" | "android" | "freebsd" | "netbsd" | "openbsd" => {
            // Not `rustc-cdylib-link-arg`: that one is passed on to the shared objects of crates that use this one, and
            // they would be called libvg.so.0 too.
            println!("cargo::rustc-link-arg=-Wl,-soname,libvg.so.0");
            // A thread that called the library runs the library's destructors of its thread-local memory when it ends,
            // which may be after dlclose: the code must stay. Passed on to shared objects of crates that use this one,
            // because they hold the same destructors.
            println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
            // The program is a library to nobody.
            println!("cargo::rustc-link-arg-bins=-Wl,-soname=");
        }
        "macos" => println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libvg.0.dylib"),
        _ => {}
    }
}
