//! The Python package: words that options take, signatures and docstrings, and the ctypes of C's options.

use crate::c::by_number;
use crate::text::{Entry, Named, camel, merged, named_line, paragraph, shouted, within, wrapped};
use vg::geometry::choice::Enumeration;
use vg::geometry::measures::Measure;
use vg::geometry::options::{Face, Field, Kind, Value};

/// Everything of a set.
const ALL: &str = "all";

/// `_types.py`: the words of each enumeration.
pub(crate) fn types(source: &str) -> String {
    let used = |e: &Enumeration| {
        let of = |field: &Field| matches!(field.kind, Kind::Choice(f) | Kind::Set(f) if f().name == e.name);
        source.contains(&format!("\n{}: TypeAlias = Literal[", camel(e.name)))
            || crate::options(Face::Python).iter().any(of)
    };
    let mut aliases: Vec<Entry> = Vec::new();
    for e in crate::enumerations().iter().filter(|e| used(e)) {
        let name = camel(e.name);
        let all = (e.name == "keep").then_some(ALL);
        let words = e.variants.iter().map(|v| v.name).chain(all).map(quoted).collect::<Vec<_>>().join(", ");
        aliases.push(Entry::new(&name, format!("{name}: TypeAlias = Literal[{words}]\n")));
    }
    let mut source = source.to_owned();
    for alias in aliases {
        let start = format!("\n{}: TypeAlias = Literal[", alias.name);
        source = match source.find(&start).map(|at| at + 1) {
            Some(at) => {
                let end = at + source[at..].find('\n').unwrap() + 1;
                // One that takes something else as well is not only the enumeration's.
                if source[at..end].ends_with("]\n") {
                    source.replace_range(at..end, &alias.text);
                }
                source
            }
            None => {
                let e = crate::enumerations().into_iter().find(|e| camel(e.name) == alias.name).unwrap();
                source.replacen(
                    "\n\n#: Floats",
                    &format!("\n#: {}\n{}\n\n#: Floats", paragraph(e.doc), alias.text),
                    1,
                )
            }
        };
    }
    source
}

fn quoted(word: &str) -> String {
    format!("\"{word}\"")
}

fn name(field: &Field) -> &'static str {
    field.facts.short.unwrap_or(field.name)
}

/// `_reconstruct.py`: signature, docstring, and the dictionary for the extension module.
pub(crate) fn reconstruct(source: &str) -> String {
    let fields = crate::options(Face::Python);
    let of = |text: &dyn Fn(&Field) -> String| -> Vec<Entry> {
        fields.iter().map(|field| Entry::new(name(field), text(field))).collect()
    };
    let source = within(source, "\ndef reconstruct(\n", ") -> Reconstruction:\n", |list| {
        let signature = of(&|field| parameter(field, ""));
        merged(list, |line| named_line(line, "    "), Named::First, &signature, Some("threads"))
    });
    let start = "\"\"\"Reconstructs the vehicle in the photographs.\n";
    let source = within(&source, start, "\n    >>> ", |list| {
        merged(list, documented, Named::First, &of(&documentation), Some("threads"))
    });
    within(&source, "        options={\n", "        },\n", |list| {
        let values = of(&|field| {
            let name = name(field);
            let value = match field.kind {
                Kind::Set(_) => format!("[{name}] if isinstance({name}, str) else listed({name}, {name:?})"),
                _ => name.to_owned(),
            };
            format!("            {name:?}: {value},\n")
        });
        let key = |line: &str| line.trim_start().strip_prefix('"')?.split('"').next().map(str::to_owned);
        merged(list, key, Named::First, &values, None)
    })
}

/// `    prior: ...` of a docstring; other words before a colon, as in "None: all", name no parameter.
fn documented(line: &str) -> Option<String> {
    let (names, rest) = line.strip_prefix("    ")?.split_once(": ")?;
    let is_name = |name: &str| {
        name.starts_with(|c: char| c.is_ascii_lowercase())
            && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    };
    (!rest.is_empty() && names.split(", ").all(is_name)).then(|| names.to_owned())
}

/// A parameter with its type and default; `types` is the module of the types, and a dot.
fn parameter(field: &Field, types: &str) -> String {
    let (kind, default) = match (field.kind, &field.default) {
        (Kind::Choice(e), Value::Name(name)) => (format!("{types}{}", camel(e().name)), quoted(name)),
        (Kind::Set(e), _) => {
            let name = format!("{types}{}", camel(e().name));
            (format!("{name} | Iterable[{name}]"), "()".to_owned())
        }
        (Kind::Flag, Value::Flag(yes)) => ("bool".to_owned(), if *yes { "True" } else { "False" }.to_owned()),
        (Kind::Whole, value) => ("int".to_owned(), number(value)),
        (Kind::MaybeWhole, value) => ("int | None".to_owned(), number(value)),
        (Kind::Real, value) => ("float".to_owned(), number(value)),
        (Kind::MaybeReal, value) => ("float | None".to_owned(), number(value)),
        (kind, value) => panic!("{}: {value:?} of {kind:?}", field.name),
    };
    format!("    {}: {kind} = {default},\n", name(field))
}

fn number(value: &Value) -> String {
    match value {
        Value::Absent => "None".to_owned(),
        Value::Real(number) => format!("{number:?}"),
        Value::Whole(number) => {
            // 12_000_000
            let digits = number.to_string();
            let groups = digits.as_bytes().rchunks(3).rev();
            groups.map(|group| std::str::from_utf8(group).unwrap()).collect::<Vec<_>>().join("_")
        }
        other => panic!("{other:?} is no number"),
    }
}

fn documentation(field: &Field) -> String {
    let mut help = in_python(field.facts.help);
    help[..1].make_ascii_lowercase();
    if let Kind::Set(e) = field.kind {
        let words: Vec<String> = e().variants.iter().map(|v| quoted(v.name)).collect();
        help += &format!(": {}, or \"{ALL}\"", words.join(", "));
    }
    if let Kind::Choice(e) = field.kind {
        for variant in e().variants {
            help = help.replace(&format!("({})", variant.name), &format!("({})", quoted(variant.name)));
        }
    }
    // Bounds that are more than what goes without saying.
    if let Some(range) = field.facts.range.filter(|range| range.high < f64::MAX) {
        help += &format!("; {}", range.words);
    }
    help.push('.');
    if let Some(none) = field.facts.none {
        help += &format!(" None: {none}.");
    }
    wrapped(&help, &format!("    {}: ", name(field)), "    ")
}

/// The program's flags by their names in Python.
fn in_python(help: &str) -> String {
    let words = help.split(' ').map(|word| match word.strip_prefix("--") {
        Some(flag) => flag.replace('-', "_"),
        None => word.to_owned(),
    });
    words.collect::<Vec<_>>().join(" ")
}

/// `capi.py`: the enumerations, C's struct, the signature, and what sets the struct.
pub(crate) fn capi(source: &str) -> String {
    let mut source = source.to_owned();
    for e in crate::enumerations() {
        let start = format!("\"\"\"vg_{}\"\"\"\n\n    ", e.name);
        if source.contains(&start) {
            source = within(&source, &start, "\n", |line| members(&e, line));
        }
    }
    let (fields, in_c) = (crate::options(Face::Python), crate::options(Face::C));
    let source = within(&source, "class vg_options(ct.Structure):\n    _fields_ = (\n", "    )\n", |list| {
        let declared = |field: &Field| {
            let kind = match field.kind {
                Kind::Choice(_) | Kind::Flag | Kind::Whole => "c_int32",
                Kind::Set(_) => "c_uint32",
                Kind::MaybeWhole => "c_size_t",
                Kind::Real | Kind::MaybeReal => "c_double",
            };
            Entry::new(field.name, format!("        ({:?}, ct.{kind}),\n", field.name))
        };
        let key = |line: &str| line.trim_start().strip_prefix("(\"")?.split('"').next().map(str::to_owned);
        merged(list, key, Named::First, &in_c.iter().map(declared).collect::<Vec<_>>(), None)
    });
    let source = within(&source, "\ndef reconstruct(\n", ") -> Reconstruction:\n", |list| {
        // Takes bits as well.
        let named = fields.iter().filter(|field| !matches!(field.kind, Kind::Set(_)));
        let signature: Vec<Entry> =
            named.map(|field| Entry::new(name(field), parameter(field, "_types."))).collect();
        merged(list, |line| named_line(line, "    "), Named::First, &signature, Some("names"))
    });
    within(&source, "    # The options of the library's table.\n", "    # The others.\n", |_| {
        fields.iter().map(set).collect()
    })
}

/// The members of an enumeration with their numbers, and those before them that only C has.
fn members(e: &Enumeration, line: &str) -> String {
    let variants = by_number(e);
    let own = (line.starts_with("NONE, ")).then_some(("NONE".to_owned(), 0));
    let all = own.into_iter().chain(variants.iter().map(|v| (shouted(v.ident), v.number)));
    let (names, numbers): (Vec<String>, Vec<i32>) = all.unzip();
    let (first, end) = (numbers[0], numbers[0] + numbers.len() as i32);
    let values = match (first..end).eq(numbers.iter().copied()) {
        true if first == 0 => format!("range({end})"),
        true => format!("range({first}, {end})"),
        false => numbers.iter().map(i32::to_string).collect::<Vec<_>>().join(", "),
    };
    format!("{} = {values}", names.join(", "))
}

fn set(field: &Field) -> String {
    let name = name(field);
    let words = field.facts.range.map_or("0 or above", |range| range.words);
    let bounds = || {
        let range = field.facts.range;
        let low = range.map_or(0.0, |range| range.low);
        match range.map_or(f64::MAX, |range| range.high) {
            f64::MAX => format!("{low}, sys.maxsize"),
            high => format!("{low}, {high}"),
        }
    };
    let value = match field.kind {
        Kind::Choice(e) => format!("_choice({}, {name:?}, {name})", camel(e().name)),
        Kind::Set(_) => format!("_kept({name})"),
        Kind::Flag => name.to_owned(),
        Kind::Whole => format!("whole({name}, {name:?}, {}, {words:?})", bounds()),
        Kind::MaybeWhole => format!("_whole_or_0({name}, {name:?}, {}, {words:?})", bounds()),
        Kind::Real => format!("real({name}, {name:?})"),
        Kind::MaybeReal => format!("_real_or_0({name}, {name:?}, {words:?})"),
    };
    format!("    options.{} = {value}\n", field.name)
}

/// `_evaluate.py`: the row of a view.
pub(crate) fn scores(source: &str) -> String {
    tuple(source, "ViewScore", crate::MEASURES[0].2)
}

/// `_measures.py`: the tuples of measures.
pub(crate) fn measures(source: &str) -> String {
    crate::MEASURES
        .iter()
        .fold(source.to_owned(), |source, (name, _, measures)| tuple(&source, name, measures))
}

/// A tuple with its measures.
fn tuple(source: &str, name: &str, measures: &[Measure]) -> String {
    let entry = |measure: &Measure| {
        let kind = if measure.may_lack { "float | None" } else { "float" };
        let doc =
            paragraph(measure.doc).replace("options.", "").replace("f_score_m", "f_score").replace('`', "");
        let doc = wrapped(&format!("{doc}\"\"\""), "    \"\"\"", "    ");
        Entry::new(measure.name, format!("    {}: {kind}\n{doc}", measure.name))
    };
    let wanted: Vec<Entry> = measures.iter().map(entry).collect();
    let at = source.find(&format!("class {name}(NamedTuple):\n")).unwrap();
    let start = at + source[at..].find("\"\"\"\n\n").unwrap() + 5;
    let end = source[start..].find("\n\n").map_or(source.len(), |n| start + n + 1);
    // Not a line that goes on with "metres, ...".
    let declared =
        |line: &str| named_line(line, "    ").filter(|_| line.contains(": float") || line.contains(": str"));
    let list = merged(&source[start..end], declared, Named::First, &wanted, None);
    format!("{}{list}{}", &source[..start], &source[end..])
}
