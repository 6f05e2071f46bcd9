//! Size, alignment and offset of everything in the header, as a C compiler sees it.

use crate::tools::{self, assert_golden, have, root, run, scratch};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// The header's structs with their fields, and its enumerators.
#[derive(Default)]
pub(crate) struct Contents {
    structs: Vec<(String, Vec<String>)>,
    enumerators: Vec<String>,
}

impl Contents {
    /// Reads a header that either generator made: one field or enumerator per line, comments on lines of their own.
    pub(crate) fn of(header: &str) -> Self {
        let mut contents = Self::default();
        let mut fields: Option<Vec<String>> = None;
        let mut in_enum = false;
        for line in header.lines().map(str::trim) {
            if line.starts_with(['*', '/', '#']) || line.is_empty() {
                continue;
            }
            if line.starts_with("typedef struct") && line.ends_with('{') {
                fields = Some(Vec::new());
            } else if line.starts_with("enum ") {
                in_enum = true;
            } else if let Some(rest) = line.strip_prefix('}') {
                in_enum = false;
                if let Some(fields) = fields.take() {
                    let name = rest.trim().trim_end_matches(';').trim().to_owned();
                    contents.structs.push((name, fields));
                }
            } else if let Some(fields) = &mut fields {
                fields.push(field_name(line));
            } else if in_enum && line.starts_with("VG_") {
                contents.enumerators.push(line.split([' ', '=', ',']).next().unwrap().to_owned());
            }
        }
        contents.structs.sort();
        contents
    }

    pub(crate) fn only(mut self, prefix: &str) -> Self {
        self.structs.retain(|(name, _)| name.starts_with(prefix));
        self
    }

    /// A program that prints all of it.
    fn program(&self, include: &str) -> String {
        let mut program = format!(
            "#include <stdio.h>\n#include <stddef.h>\n#include {include:?}\n\
             #ifdef __cplusplus\n#define ALIGN alignof\n#else\n#define ALIGN _Alignof\n#endif\nint main(void) {{\n"
        );
        for (name, fields) in &self.structs {
            let _ = writeln!(program, "printf(\"{name} size %zu align %zu\\n\", sizeof({name}), ALIGN({name}));");
            for field in fields {
                let _ = writeln!(
                    program,
                    "printf(\"{name}.{field} at %zu size %zu\\n\", offsetof({name}, {field}), sizeof((({name} *)0)->{field}));"
                );
            }
        }
        for enumerator in &self.enumerators {
            let _ = writeln!(program, "printf(\"{enumerator} = %d\\n\", (int){enumerator});");
        }
        program + "return 0;\n}\n"
    }

    /// What the program prints under a compiler.
    pub(crate) fn printed_by(&self, compiler: &str, standard: &str, include: &Path) -> String {
        let folder = scratch();
        let is_cxx = standard.starts_with("c++");
        let source = folder.path().join(if is_cxx { "layout.cpp" } else { "layout.c" });
        std::fs::write(&source, self.program(include.to_str().unwrap())).unwrap();
        let program = folder.path().join("layout");
        run(Command::new(compiler).arg(format!("-std={standard}")).arg(&source).arg("-o").arg(&program));
        run(&mut Command::new(program))
    }
}

/// The name in `double params[16];`, `vg_progress_fn progress;` or `void (*log)(int, char const *);`.
fn field_name(line: &str) -> String {
    let declarator = match line.split_once("(*") {
        Some((_, rest)) => rest.split(')').next().unwrap(),
        None => line.split(['[', ';']).next().unwrap().rsplit([' ', '*']).next().unwrap(),
    };
    declarator.trim().to_owned()
}

#[test]
fn c_and_cxx_see_the_golden_layout() {
    if !cfg!(all(target_arch = "x86_64", target_pointer_width = "64")) {
        tools::say("skipped: the golden layout is of x86-64");
        return;
    }
    let header = root().join("include/vg.h");
    let contents = Contents::of(&std::fs::read_to_string(&header).unwrap());
    assert!(contents.structs.len() >= 10 && contents.enumerators.len() >= 30, "the header was not understood");
    let mut seen = Vec::new();
    for (compiler, standards) in
        [(tools::cc(), ["c11", "c2x"]), (tools::cxx(), ["c++17", "c++20"])]
    {
        if have(&compiler, "gcc g++", "layout") {
            seen.extend(standards.map(|standard| contents.printed_by(&compiler, standard, &header)));
        }
    }
    for printed in &seen {
        let why = "programs were compiled with the golden layout: a struct may only grow at its end, an enumeration \
                   only get new numbers; such a change is blessed with VG_BLESS=1";
        assert_golden(&tools::golden().join("layout_x86_64.txt"), printed, why);
    }
}
