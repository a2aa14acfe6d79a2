//! Types whose values have names, by which options ask for them and records tell of them.

/// Gives an enum its list `ALL`, the `name` of each value, and both ways between values and names.
macro_rules! named {
    ($type:ident, $what:literal: $($value:ident = $name:literal),+ $(,)?) => {
        impl $type {
            /// All of them, in the order of options, charts and tables.
            pub const ALL: [$type; [$($name),+].len()] = [$($type::$value),+];

            /// The name that options and records use.
            pub fn name(self) -> &'static str {
                match self {
                    $($type::$value => $name),+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::Error;

            fn from_str(name: &str) -> $crate::Result<$type> {
                $type::ALL.into_iter().find(|value| value.name() == name).ok_or_else(|| {
                    let names = $type::ALL.map($type::name).join(", ");
                    $crate::Error::Argument(format!("unknown {} {name:?}; use one of {names}", $what))
                })
            }
        }
    };
}

pub(crate) use named;
