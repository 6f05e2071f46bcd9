//! The contents of a generated header, and a program that prints their sizes, alignments, offsets and numbers.
#![allow(dead_code, unreachable_pub)] // the library's own tests use a part of it

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use vg_testing::tools::{run, scratch};

/// The header's structs with their fields, and its enumerators.
#[derive(Default)]
pub struct Contents {
    structs: Vec<(String, Vec<String>)>,
    enumerators: Vec<String>,
}

impl Contents {
    /// Parses a header of either generator: one field or enumerator per line, comments on lines of their own.
    pub fn of(header: &str) -> Self {
        let mut contents = Self::default();
        let mut fields: Option<(String, Vec<String>)> = None;
        let mut in_enum = false;
        for line in header.lines().map(str::trim) {
            if line.starts_with(['*', '/', '#']) || line.is_empty() {
                continue;
            }
            if let Some(tag) = line.strip_prefix("typedef struct ").and_then(|l| l.strip_suffix('{')) {
                fields = Some((tag.trim().to_owned(), Vec::new()));
            } else if line.starts_with("enum ") {
                in_enum = true;
            } else if line.starts_with('}') {
                in_enum = false;
                // safer-ffi wraps arrays in structs without a name.
                contents.structs.extend(fields.take().filter(|(tag, _)| !tag.is_empty()));
            } else if let Some((_, fields)) = &mut fields {
                fields.push(field_name(line));
            } else if in_enum && line.starts_with("VG_") {
                contents.enumerators.push(line.split([' ', '=', ',']).next().unwrap().to_owned());
            }
        }
        contents.structs.sort();
        contents
    }

    pub fn structs(&self) -> usize {
        self.structs.len()
    }

    pub fn enumerators(&self) -> usize {
        self.enumerators.len()
    }

    /// Source of a program that prints all of it.
    fn program(&self, include: &str) -> String {
        let mut program = format!(
            "#include <stdio.h>\n#include <stddef.h>\n#include {include:?}\n\
             #ifdef __cplusplus\n#define ALIGN alignof\n#else\n#define ALIGN _Alignof\n#endif\nint main(void) {{\n"
        );
        for (name, fields) in &self.structs {
            let _ = writeln!(
                program,
                "printf(\"{name} size %zu align %zu\\n\", sizeof(struct {name}), ALIGN(struct {name}));"
            );
            for field in fields {
                let _ = writeln!(
                    program,
                    "printf(\"{name}.{field} at %zu size %zu\\n\", offsetof(struct {name}, {field}), sizeof(((struct {name} *)0)->{field}));"
                );
            }
        }
        for enumerator in &self.enumerators {
            let _ = writeln!(program, "printf(\"{enumerator} = %d\\n\", (int){enumerator});");
        }
        program + "return 0;\n}\n"
    }

    /// Output of the program under a compiler.
    pub fn printed_by(&self, compiler: &str, standard: &str, include: &Path) -> String {
        let folder = scratch();
        let is_cxx = standard.starts_with("c++");
        let source = folder.path().join(if is_cxx { "layout.cpp" } else { "layout.c" });
        std::fs::write(&source, self.program(include.to_str().unwrap())).unwrap();
        let program = folder.path().join("layout");
        run(Command::new(compiler).arg(format!("-std={standard}")).arg(&source).arg("-o").arg(&program));
        run(&mut Command::new(program))
    }
}

/// Names of the functions that a header declares.
pub fn functions(header: &str) -> BTreeSet<String> {
    let lines: Vec<&str> = header.lines().collect();
    let declarations = lines.windows(2).filter(|pair| pair[0] == "VG_API").map(|pair| pair[1]);
    declarations
        .map(|line| line.split('(').next().unwrap().rsplit([' ', '*']).next().unwrap().to_owned())
        .collect()
}

/// The name in `double params[16];`, `vg_progress_fn progress;` or `void (*log)(int, char const *);`.
fn field_name(line: &str) -> String {
    let declarator = match line.split_once("(*") {
        Some((_, rest)) => rest.split(')').next().unwrap(),
        None => line.split(['[', ';']).next().unwrap().rsplit([' ', '*']).next().unwrap(),
    };
    declarator.trim().to_owned()
}
