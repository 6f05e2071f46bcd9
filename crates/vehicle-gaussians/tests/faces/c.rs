//! `src/capi`: the text that cbindgen makes `include/vg.h` of, and what converts C's options to the library's.

use crate::text::{Entry, Named, merged, named_line, paragraph, shouted, within, words_differ, wrapped};
use vg::geometry::choice::Enumeration;
use vg::geometry::measures::Measure;
use vg::geometry::options::{Face, Field, Kind, Value};

/// The struct, its defaults, and its way into the library.
pub(crate) fn options(source: &str) -> String {
    let fields = crate::options(Face::C);
    let of = |text: fn(&Field) -> String| -> Vec<Entry> {
        fields.iter().map(|field| Entry::new(field.name, text(field))).collect()
    };
    let declared = |line: &str| named_line(line, "    pub ");
    let source = within(source, "pub struct vg_options {\n", "}\n", |list| {
        merged(list, declared, Named::Last, &of(declaration), None)
    });
    let set = |line: &str| named_line(line, "            ");
    let source =
        within(&source, "        let rust = Options::default();\n        Self {\n", "        }\n", |list| {
            merged(list, set, Named::First, &of(initial), None)
        });
    within(&source, "        Ok(Options {\n", "            ..Options::default()\n", |list| {
        merged(list, set, Named::First, &of(conversion), None)
    })
}

fn declaration(field: &Field) -> String {
    let (doc, kind) = match field.kind {
        Kind::Choice(e) => (format!("A `vg_{}`.", e().name), "i32"),
        Kind::Set(e) => (format!("Bits of `vg_{}`.", e().name), "u32"),
        Kind::Flag | Kind::Whole => (translated(&paragraph(field.doc)), "i32"),
        Kind::MaybeWhole => (translated(&paragraph(field.doc)), "usize"),
        Kind::Real | Kind::MaybeReal => (translated(&paragraph(field.doc)), "f64"),
    };
    let default = default(field);
    let doc = match doc.split_once("Default ") {
        None => format!("{doc} Default {default}."),
        Some((_, stated)) => {
            assert!(stated.starts_with(&default), "{}: its default is {default}", field.name);
            doc
        }
    };
    format!("{}    pub {}: {kind},\n", wrapped(&doc, "    /// ", "    /// "), field.name)
}

fn default(field: &Field) -> String {
    match (&field.default, field.kind) {
        (Value::Absent, _) => "0".to_owned(),
        (Value::Flag(yes), _) => i32::from(*yes).to_string(),
        (Value::Whole(number), _) => number.to_string(),
        (Value::Real(number), _) => number.to_string(),
        (Value::Name(name), Kind::Choice(e)) => {
            let e = e();
            let variant = e.variants.iter().find(|v| v.name == name).unwrap();
            format!("`{}`", enumerator(&e, variant.ident))
        }
        (Value::Names(names), Kind::Set(e)) => {
            let variants = e().variants;
            let bits = variants.iter().filter(|v| names.iter().any(|n| n == v.name)).map(|v| v.number);
            bits.sum::<i32>().to_string()
        }
        (value, kind) => panic!("{}: {value:?} of {kind:?}", field.name),
    }
}

fn initial(field: &Field) -> String {
    let name = field.name;
    let value = match field.kind {
        Kind::Choice(_) => format!("rust.{name}.number()"),
        Kind::Set(e) => format!("{}_bits(rust.{name})", e().name),
        Kind::Flag | Kind::Whole => format!("i32::from(rust.{name})"),
        Kind::MaybeWhole => format!("rust.{name}.unwrap_or(0)"),
        Kind::Real => format!("rust.{name}"),
        Kind::MaybeReal => format!("rust.{name}.unwrap_or(0.0)"),
    };
    format!("            {name}: {value},\n")
}

fn conversion(field: &Field) -> String {
    let name = field.name;
    let value = match field.kind {
        Kind::Choice(_) => format!("read::choice(\"options.{name}\", self.{name})?"),
        Kind::Set(e) => format!("{}(self.{name})?", e().name),
        Kind::Flag => format!("read::flag(\"options.{name}\", self.{name})?"),
        Kind::Whole => {
            let words = field.facts.range.map_or("0 or above", |range| range.words);
            format!("read::whole(\"options.{name}\", self.{name}, {words:?})?")
        }
        Kind::MaybeWhole => format!("(self.{name} != 0).then_some(self.{name})"),
        Kind::Real => format!("self.{name}"),
        Kind::MaybeReal => format!("(self.{name} != 0.0).then_some(self.{name})"),
    };
    format!("            {name}: {value},\n")
}

/// What C says of a measure.
fn documentation(measure: &Measure) -> String {
    match measure.name {
        // Stands behind `psnr_db` there.
        "psnr_box_db" => {
            "The same inside the bounding box of the mask; `None` where the mask is empty.".into()
        }
        _ => paragraph(measure.doc),
    }
}

/// The structs of measures, what they begin with, and what fills them.
pub(crate) fn measures(source: &str) -> String {
    let mut source = source.to_owned();
    for (name, name_in_c, measures) in crate::MEASURES {
        let of = |text: fn(&Measure) -> String| -> Vec<Entry> {
            measures.iter().map(|measure| Entry::new(measure.name, text(measure))).collect()
        };
        let declared = of(|measure| {
            let doc = translated(&documentation(measure).replace("`None`", "NAN"));
            format!("{}    pub {}: f64,\n", wrapped(&doc, "    /// ", "    /// "), measure.name)
        });
        source = within(&source, &format!("pub struct vg_{name_in_c} {{\n"), "}\n", |list| {
            merged(list, |line| named_line(line, "    pub "), Named::Last, &declared, None)
        });
        let at = source.find(&format!("unsafe impl Versioned for vg_{name_in_c} ")).unwrap();
        let set = |line: &str| named_line(line, "            ");
        let initial = within(&source[at..], "        Self {\n", "        }\n", |list| {
            merged(list, set, Named::First, &of(|m| format!("            {}: NONE,\n", m.name)), None)
        });
        source.replace_range(at.., &initial);
        let at = source.find(&format!("impl From<&{name}> for vg_{name_in_c} ")).unwrap();
        let filled = within(&source[at..], "        Self {\n", "            ..Self::initial()\n", |list| {
            let value = |m: &Measure| match m.may_lack {
                true => format!("            {0}: or_nan(errors.{0}),\n", m.name),
                false => format!("            {0}: errors.{0},\n", m.name),
            };
            merged(list, set, Named::First, &of(value), None)
        });
        source.replace_range(at.., &filled);
    }
    source
}

/// `src/capi/tests.rs`: the fields of the structs and the variants of the enumerations that are kept in step here.
pub(crate) fn witness(source: &str) -> String {
    let mut source = source.to_owned();
    let structs =
        [("options", "vg_options"), ("metrics", "vg_view_errors"), ("metrics", "vg_surface_errors")];
    for (file, name) in structs {
        let declared =
            std::fs::read_to_string(vg_testing::root().join(format!("src/capi/{file}.rs"))).unwrap();
        let from = declared.find(&format!("pub struct {name} {{\n")).unwrap();
        let to = from + declared[from..].find("}\n").unwrap();
        let fields = declared[from..to].lines().filter_map(|line| named_line(line, "    pub "));
        let fields = fields.collect::<Vec<_>>().join(" ");
        source = within(&source, &format!("\n        {name} {{"), "}", |list| {
            let wanted = format!("\n{}        ", wrapped(&fields, "            ", "            "));
            if words_differ(list, &wanted) { wanted } else { list.to_owned() }
        });
    }
    for e in crate::enumerations() {
        source = within(&source, &format!("\n        vg_{} {{ ", e.name), " }", |list| {
            let own = if list.starts_with("None ") { "None " } else { "" };
            let idents: Vec<&str> = by_number(&e).iter().map(|v| v.ident).collect();
            format!("{own}{}", idents.join(" "))
        });
    }
    source
}

/// The variants of every enumeration that a file has.
pub(crate) fn enumerations(source: &str) -> String {
    let mut source = source.to_owned();
    for e in crate::enumerations() {
        let start = format!("pub enum vg_{} {{\n", e.name);
        if let Some(at) = source.find(&start) {
            let entries: Vec<Entry> =
                by_number(&e).into_iter().map(|v| Entry::new(v.ident, variant(&v))).collect();
            let name_of = |line: &str| named_line(line, "    ");
            source =
                within(&source, &start, "}\n", |list| merged(list, name_of, Named::Last, &entries, None));
            // The lines above: attributes, and above them the documentation.
            let attributes = source[..at].rfind("#[repr(i32)]").unwrap();
            let documented = source[..attributes].rfind("\n\n").unwrap() + 2;
            let doc = wrapped(&translated(&paragraph(e.doc)), "/// ", "/// ");
            let written = &source[documented..attributes];
            if words_differ(written, &doc) && e.name != "calibration" {
                source.replace_range(documented..attributes, &doc);
            }
        }
    }
    source
}

fn variant(variant: &vg::geometry::choice::Variant) -> String {
    let doc = wrapped(&translated(&paragraph(variant.doc)), "    /// ", "    /// ");
    format!("{doc}    {} = {},\n", variant.ident, variant.number)
}

/// In the order of C.
pub(crate) fn by_number(e: &Enumeration) -> Vec<vg::geometry::choice::Variant> {
    let mut variants = e.variants.clone();
    variants.sort_by_key(|variant| variant.number);
    variants
}

fn enumerator(e: &Enumeration, ident: &str) -> String {
    format!("VG_{}_{}", e.name.to_uppercase(), shouted(ident))
}

/// A documentation of Rust with C's names and values.
fn translated(doc: &str) -> String {
    let mut rest = doc;
    let mut out = String::new();
    while let Some(start) = rest.find("[`") {
        let Some(end) = rest[start..].find("`]").map(|n| start + n) else { break };
        out += &rest[..start];
        out += &format!("`{}`", reference(&rest[start + 2..end]));
        rest = &rest[end + 2..];
        // The target of a link.
        if rest.starts_with('(') {
            rest = &rest[rest.find(')').unwrap() + 1..];
        }
    }
    out += rest;
    out.replace("`None`", "0").replace("`true`", "1").replace("`false`", "0")
}

fn reference(path: &str) -> String {
    let Some((of, item)) = path.split_once("::") else { return path.to_owned() };
    match of {
        "Options" => format!("vg_options.{item}"),
        "Error" => format!("VG_STATUS_{}", shouted(item)),
        _ => {
            let enumerations = crate::enumerations();
            let e = enumerations.iter().find(|e| e.type_name == of);
            enumerator(e.unwrap_or_else(|| panic!("C has no {path}")), item)
        }
    }
}
