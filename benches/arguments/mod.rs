//! The arguments of the benchmarks.

/// The arguments of this process.
pub struct Arguments(Vec<String>);

impl Arguments {
    /// Reads them. `None` if `cargo test --benches` runs the benchmark, which asks for no measurement.
    pub fn read() -> Option<Self> {
        let all: Vec<String> = std::env::args().collect();
        (!all.iter().any(|argument| argument == "--test")).then_some(Self(all))
    }

    /// The argument behind a flag.
    pub fn option(&self, flag: &str) -> Option<&str> {
        let at = self.0.iter().position(|argument| argument == flag)?;
        self.0.get(at + 1).map(String::as_str)
    }

    /// The number behind `--rounds`.
    pub fn rounds(&self, default: usize) -> usize {
        self.option("--rounds").map_or(default, |n| n.parse().expect("a number of rounds"))
    }
}
