//! Names as pages and files have them: short ones of builders for labels, which are what `-b` takes less what every reader knows.

/// `lbvh:codes=emc64var:collapse=off` as `lbvh emc64var, uncollapsed`.
pub fn short(builder: &str) -> String {
    let mut parts = builder.split(':');
    let name = parts.next().unwrap_or_default();
    let options: Vec<String> = parts
        .map(|option| match option.split_once('=') {
            Some(("codes", codes)) => codes.to_owned(),
            Some(("collapse", "off")) => "uncollapsed".to_owned(),
            Some(("collapse", "sah")) => "collapsed".to_owned(),
            Some((key, value)) => format!("{key} {value}"),
            None => option.to_owned(),
        })
        .collect();
    if options.is_empty() { name.to_owned() } else { format!("{name} {}", options.join(", ")) }
}

/// A name that files and HTML identifiers can have: ASCII letters, digits and `-`.
pub fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}

/// Each once, in the order in which they first appear.
pub fn distinct<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut kept = Vec::new();
    for item in items {
        if !kept.contains(&item) {
            kept.push(item);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_leave_out_what_every_reader_knows() {
        assert_eq!(short("lbvh"), "lbvh");
        assert_eq!(short("lbvh:codes=emc64var:collapse=off"), "lbvh emc64var, uncollapsed");
        assert_eq!(short("ploc:radius=25"), "ploc radius 25");
    }

    #[test]
    fn slugs_name_files() {
        assert_eq!(slug("gen:soup:1000:7"), "gen-soup-1000-7");
        assert_eq!(slug("lbvh:codes=mc63+concise"), "lbvh-codes-mc63-concise");
    }
}
