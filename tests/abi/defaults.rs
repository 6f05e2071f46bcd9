//! Values of every field of every struct after its `_init` function, printed by a C program.

use crate::contents::functions;
use std::fmt::Write;
use std::process::Command;
use vg_testing::root;
use vg_testing::tools::{STRICT, assert_golden, cc, compile, golden, have, library_folder, run, scratch};

/// A field from its declaration in the header.
struct Field {
    name: String,
    kind: Kind,
}

/// The way a field is printed.
enum Kind {
    Number { conversion: &'static str, cast: &'static str },
    Numbers { conversion: &'static str, cast: &'static str },
    Pointer,
    Struct(String),
}

/// The structs of the header with their fields, in its order.
fn structs(header: &str) -> Vec<(String, Vec<Field>)> {
    let mut structs = Vec::new();
    let mut inside: Option<(String, Vec<Field>)> = None;
    let code = header.lines().map(str::trim).filter(|line| !line.starts_with(['*', '/', '#']));
    for line in code {
        if let Some(name) = line.strip_prefix("typedef struct ").and_then(|l| l.strip_suffix(" {")) {
            inside = Some((name.to_owned(), Vec::new()));
        } else if line.starts_with('}') {
            structs.extend(inside.take());
        } else if let (Some((_, fields)), Some(declaration)) = (&mut inside, line.strip_suffix(';')) {
            fields.push(field(declaration));
        }
    }
    structs
}

/// `double vehicle_size[3]`, `vg_progress_fn progress`, `const float *cloud`, `struct vg_image mask`.
fn field(declaration: &str) -> Field {
    let (declaration, is_array) = match declaration.split_once('[') {
        Some((before, _)) => (before, true),
        None => (declaration, false),
    };
    let at = declaration.rfind([' ', '*']).expect("a type and a name") + 1;
    let (of, name) = (declaration[..at].trim(), declaration[at..].to_owned());
    let number = |conversion, cast| match is_array {
        true => Kind::Numbers { conversion, cast },
        false => Kind::Number { conversion, cast },
    };
    let kind = match of {
        "int32_t" => number("%ld", "long"),
        "uint32_t" | "uint64_t" | "size_t" => number("%llu", "unsigned long long"),
        "float" => number("%.9g", "double"),
        "double" => number("%.17g", "double"),
        of if of.ends_with('*') || of.ends_with("_fn") => Kind::Pointer,
        of if of.trim_start_matches("struct ").starts_with("vg_") => {
            Kind::Struct(of.trim_start_matches("struct ").to_owned())
        }
        other => panic!("{name}: {} cannot print {other}", file!()),
    };
    Field { name, kind }
}

/// Adds code that prints the struct at `place`, one line per field, named `name.field`.
fn print(program: &mut String, all: &[(String, Vec<Field>)], of: &str, place: &str, name: &str) {
    let fields = &all.iter().find(|(n, _)| n == of).unwrap_or_else(|| panic!("no struct {of}")).1;
    for field in fields {
        let (place, name) = (format!("{place}.{}", field.name), format!("{name}.{}", field.name));
        let _ = match &field.kind {
            // The size grows with the struct; the golden layout tests it.
            _ if field.name == "struct_size" => {
                writeln!(
                    program,
                    "printf(\"{name} = %s\\n\", {place} == sizeof(struct {of}) ? \"sizeof\" : \"?\");"
                )
            }
            Kind::Number { conversion, cast } => {
                writeln!(program, "printf(\"{name} = {conversion}\\n\", ({cast}){place});")
            }
            Kind::Numbers { conversion, cast } => writeln!(
                program,
                "printf(\"{name} =\");\n\
                 for (i = 0; i < sizeof {place} / sizeof {place}[0]; i++) printf(\" {conversion}\", ({cast}){place}[i]);\n\
                 printf(\"\\n\");"
            ),
            Kind::Pointer => {
                writeln!(program, "printf(\"{name} = %s\\n\", {place} == NULL ? \"NULL\" : \"?\");")
            }
            Kind::Struct(inner) => {
                print(program, all, inner, &place, &name);
                Ok(())
            }
        };
    }
}

#[test]
fn every_field_has_its_golden_default() {
    if !have(&cc(), "gcc", "the default values") {
        return;
    }
    let header = std::fs::read_to_string(root().join("include/vg.h")).unwrap();
    let (all, functions) = (structs(&header), functions(&header));
    let mut program = "#include <stdio.h>\n#include <string.h>\n#include \"vg.h\"\n\
                       int main(void) {\nsize_t i;\n"
        .to_owned();
    for (name, fields) in &all {
        let init = format!("{name}_init");
        // vg_image never grows and has no `_init` function.
        assert_eq!(functions.contains(&init), fields[0].name == "struct_size", "{name} and {init}");
        if functions.contains(&init) {
            // Fields that the function does not set print as '?'.
            let _ = writeln!(program, "{{\n{name} s;\nmemset(&s, 0x5A, sizeof s);");
            let _ = writeln!(program, "if ({init}(&s, sizeof s) != VG_STATUS_OK) return 1;");
            print(&mut program, &all, name, "s", name);
            program.push_str("}\n");
        }
    }
    program.push_str("(void)i;\nreturn 0;\n}\n");

    let folder = scratch();
    library_folder(folder.path());
    let source = folder.path().join("defaults.c");
    std::fs::write(&source, program).unwrap();
    let mut flags = STRICT.to_vec();
    flags.push("-std=c11");
    let program = compile(&cc(), &flags, &root().join("include"), &source, folder.path(), "defaults");
    let printed = run(&mut Command::new(program));
    assert!(!printed.contains('?') && printed.lines().count() > 100, "{printed}");
    let why = "programs rely on what _init leaves: before the first release a default may change with a line in \
               CHANGELOG.md, after it never; a new field gets a line here with VG_BLESS=1";
    assert_golden(&golden().join("defaults.txt"), &printed, why);
}
