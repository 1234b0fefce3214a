//! Text and tables as HTML. All text is escaped here.

use std::fmt::Write as _;

use serde_json::Value;

use crate::source::words::escaped;

/// A link to a section, which may ask it to show a channel and a pixel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Link {
    /// The id of the section.
    pub to: String,
    /// The channel to show.
    pub channel: Option<String>,
    /// The row and the column of the pixel to show.
    pub pixel: Option<[usize; 2]>,
}

impl Link {
    /// The link around a text.
    pub fn around(&self, text: &str) -> String {
        let channel = self.channel.as_deref().unwrap_or_default();
        let pixel =
            self.pixel.map_or(String::new(), |[row, column]| format!(" data-pixel=\"{row},{column}\""));
        format!(
            "<a href=\"#{}\" data-channel=\"{}\"{pixel}><bdi>{}</bdi></a>",
            self.to,
            escape(channel),
            escape(text)
        )
    }
}

/// A cell of a table.
pub(super) enum Cell {
    Text(String),
    Code(String),
    Number(String),
    /// Texts, some of which lead somewhere.
    Links(Vec<(String, Option<Link>)>),
    Verdict(bool, &'static str),
}

/// A table with a caption, which scrolls if it is too wide.
pub(super) fn table(caption: &str, head: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut html =
        format!("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\"><table>");
    let _ = write!(html, "<caption>{caption}</caption><thead><tr>");
    for name in head {
        let _ = write!(html, "<th scope=\"col\">{name}</th>");
    }
    html += "</tr></thead><tbody>";
    for row in rows {
        html += "<tr>";
        for cell in row {
            let _ = match cell {
                Cell::Text(text) => write!(html, "<td><bdi>{}</bdi></td>", escape(&text)),
                Cell::Code(text) => write!(html, "<td><code><bdi>{}</bdi></code></td>", escape(&text)),
                Cell::Number(text) => write!(html, "<td class=\"number\">{}</td>", escape(&text)),
                Cell::Links(parts) => {
                    let part = |(text, link): (String, Option<Link>)| match link {
                        Some(link) => link.around(&text),
                        None => format!("<bdi>{}</bdi>", escape(&text)),
                    };
                    let parts: Vec<String> = parts.into_iter().map(part).collect();
                    write!(html, "<td>{}</td>", parts.join(", "))
                }
                Cell::Verdict(good, text) => {
                    let class = if good { "good" } else { "bad" };
                    write!(html, "<td><span class=\"verdict {class}\">{text}</span></td>")
                }
            };
        }
        html += "</tr>";
    }
    html + "</tbody></table></div>"
}

/// Writes text for HTML, in content and in attributes. Characters that control, which HTML can't have or which turn the text
/// after them around, are shown by their codes, as in messages. Scripts that are written from the right need none of them:
/// `<bdi>` keeps their names apart.
pub(super) fn escape(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for c in escaped(text).chars() {
        match c {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#39;",
            c => html.push(c),
        }
    }
    html
}

/// Data for the script.
pub(super) fn script(data: &Value) -> String {
    // Inside a script element, only `<` can end the element or begin a comment.
    format!("<script type=\"application/json\">{}</script>", data.to_string().replace('<', "\\u003c"))
}
