//! How the C library is linked: by which name programs load it, and that its code stays in memory.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let os = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    match os.as_str() {
        "linux" | "android" | "freebsd" | "netbsd" | "openbsd" => {
            // The number of the binary interface.
            println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libvg.so.0");
            // A thread that called the library runs the library's destructors of its thread-local memory when it ends,
            // which may be after dlclose: the code must stay.
            println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
        }
        "macos" => println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libvg.0.dylib"),
        _ => {}
    }
}
