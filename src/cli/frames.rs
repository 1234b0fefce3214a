//! The frames of a sequence that a subcommand looks at.

use std::ops::Range;

use crate::output::recorded::Wanted;

/// The flags of every subcommand that looks at some frames of a sequence.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct FrameArgs {
    /// Only the frames from A up to B, without B; A.. goes to the end, and A is one frame. The messages of a recording count from 0
    #[arg(long = "frames", value_name = "A..B", value_parser = parse)]
    frames: Option<Range<u64>>,
    /// Of a recording, the messages of this topic [default: the only one with clouds or depth images]
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
}

impl FrameArgs {
    /// The frames that are asked for.
    pub fn wanted(&self) -> Wanted {
        Wanted { frames: self.range(), topic: self.topic.clone() }
    }

    /// The numbers of the frames; all, unless some are asked for.
    pub fn range(&self) -> Range<u64> {
        self.frames.clone().unwrap_or(0..u64::MAX)
    }
}

/// Reads `A..B`, `A..`, `..B` or `A`.
pub fn parse(text: &str) -> Result<Range<u64>, String> {
    let number =
        |text: &str| text.trim().parse::<u64>().map_err(|_| format!("{text:?} is no frame's number"));
    let range = match text.split_once("..") {
        None => {
            let frame = number(text)?;
            frame..frame.saturating_add(1)
        }
        Some((from, to)) => {
            let from = if from.is_empty() { 0 } else { number(from)? };
            let to = if to.is_empty() { u64::MAX } else { number(to)? };
            from..to
        }
    };
    if range.is_empty() {
        return Err(format!("no frame lies in {text}: expected A..B with A less than B, such as 0..100"));
    }
    Ok(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_half_open_and_may_lack_an_end() {
        assert_eq!(parse("3..7"), Ok(3..7));
        assert_eq!(parse("3.."), Ok(3..u64::MAX));
        assert_eq!(parse("..7"), Ok(0..7));
        assert_eq!(parse("5"), Ok(5..6));
        for wrong in ["", "7..3", "3..3", "a..b", "-1..3", "1...3", "1,3"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
