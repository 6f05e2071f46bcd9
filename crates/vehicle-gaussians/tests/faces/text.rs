//! Replacing parts of a source by what a table says, and leaving the rest as it is.

/// An entry of a list in a source: its name, and its lines.
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Entry {
    pub(crate) fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), text: text.into() }
    }
}

/// Which line of an entry has its name.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Named {
    /// The first; others continue it.
    First,
    /// The last; comments lead up to it.
    Last,
}

/// The part of a source from behind `start` to before the next `end`, made anew.
#[track_caller]
pub(crate) fn within(source: &str, start: &str, end: &str, change: impl FnOnce(&str) -> String) -> String {
    let from = source.find(start).unwrap_or_else(|| panic!("no {start:?}")) + start.len();
    let to = from + source[from..].find(end).unwrap_or_else(|| panic!("no {end:?} behind {start:?}"));
    format!("{}{}{}", &source[..from], change(&source[from..to]), &source[to..])
}

/// A list with the wanted entries: those that are there are replaced where they stand, unless they differ in nothing but
/// line breaks; those that are not come before the entry `before`, or last.
pub(crate) fn merged(
    list: &str,
    name_of: impl Fn(&str) -> Option<String>,
    named: Named,
    wanted: &[Entry],
    before: Option<&str>,
) -> String {
    let mut entries: Vec<Entry> = Vec::new();
    let mut pending = String::new();
    for line in list.split_inclusive('\n') {
        match (name_of(line), named) {
            (Some(name), Named::Last) => {
                entries.push(Entry { name, text: std::mem::take(&mut pending) + line });
            }
            (Some(name), Named::First) => entries.push(Entry { name, text: line.to_owned() }),
            (None, Named::First) if !entries.is_empty() => entries.last_mut().unwrap().text.push_str(line),
            (None, _) => pending.push_str(line),
        }
    }
    let (head, tail) =
        if named == Named::First { (pending, String::new()) } else { (String::new(), pending) };
    for entry in &mut entries {
        if let Some(found) = wanted.iter().find(|w| w.name == entry.name)
            && words_differ(&entry.text, &found.text)
        {
            entry.text.clone_from(&found.text);
        }
    }
    for missing in wanted {
        if !entries.iter().any(|entry| entry.name == missing.name) {
            let at = entries.iter().position(|entry| Some(&*entry.name) == before).unwrap_or(entries.len());
            entries.insert(at, Entry::new(&missing.name, &missing.text));
        }
    }
    head + &entries.into_iter().map(|entry| entry.text).collect::<String>() + &tail
}

/// Whether two texts differ in more than their line breaks.
pub(crate) fn words_differ(a: &str, b: &str) -> bool {
    fn words(text: &str) -> impl Iterator<Item = &str> {
        text.split_whitespace().filter(|word| *word != "///")
    }
    !words(a).eq(words(b))
}

/// A paragraph in lines of at most 120 characters, each behind a prefix.
pub(crate) fn wrapped(paragraph: &str, first: &str, prefix: &str) -> String {
    let mut lines = String::new();
    let mut line = first.to_owned();
    for word in paragraph.split_whitespace() {
        let is_start = line == first || line == prefix;
        if !is_start && line.chars().count() + 1 + word.chars().count() > 120 {
            lines += &(line + "\n");
            line = prefix.to_owned();
        } else if !is_start {
            line.push(' ');
        }
        line += word;
    }
    lines + &line + "\n"
}

/// The lines of a documentation as one paragraph.
pub(crate) fn paragraph(doc: &[&str]) -> String {
    doc.iter().flat_map(|line| line.split_whitespace()).collect::<Vec<_>>().join(" ")
}

/// `name` of a line `    name: ...` or `    name = ...` with this indentation.
pub(crate) fn named_line(line: &str, indent: &str) -> Option<String> {
    let rest = line.strip_prefix(indent)?;
    let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_'))?;
    let is_name = end > 0 && rest[end..].trim_start().starts_with([':', '=', ',']);
    is_name.then(|| rest[..end].to_owned())
}

/// `VG_PRIOR_SHAPE` of `prior` and `Shape`.
pub(crate) fn shouted(name: &str) -> String {
    let mut shouted = String::new();
    for (i, c) in name.char_indices() {
        if c.is_uppercase() && i > 0 && !name[..i].ends_with('_') {
            shouted.push('_');
        }
        shouted.extend(c.to_uppercase());
    }
    shouted
}

/// `DepthMode` of `depth_mode`.
pub(crate) fn camel(name: &str) -> String {
    name.split('_').map(|part| part[..1].to_uppercase() + &part[1..]).collect()
}
