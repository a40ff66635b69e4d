//! Messages in the window.

/// How much a message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoticeWeight {
    /// Something was done.
    Info,
    /// Something was refused or went wrong.
    Warning,
}

/// A message, shown until it is dismissed; what was merely done goes by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowNotice {
    /// What it says.
    pub text: String,
    /// How much it matters.
    pub weight: NoticeWeight,
    /// When it came, seconds since the window opened.
    pub since: f64,
}

/// How long a message of weight [`NoticeWeight::Info`] stays, seconds.
const INFO_S: f64 = 6.0;
/// Most messages at a time; the oldest goes.
const MOST: usize = 4;
/// Longest text, characters: a parser may quote a whole line.
const LONGEST: usize = 600;

/// The messages that are shown.
#[derive(Debug, Clone, Default)]
pub struct NoticeList(Vec<WindowNotice>);

impl NoticeList {
    /// Adds a message; one with the same text takes its place.
    pub fn add(&mut self, text: &str, weight: NoticeWeight, now: f64) {
        let mut text = text.to_owned();
        if let Some((end, _)) = text.char_indices().nth(LONGEST) {
            text.truncate(end);
            text.push('…');
        }
        self.0.retain(|n| n.text != text);
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(WindowNotice {
            text,
            weight,
            since: now,
        });
    }

    /// What is shown, oldest first.
    pub fn list(&self) -> &[WindowNotice] {
        &self.0
    }

    /// Removes one; an index that is not there removes nothing.
    pub fn dismiss(&mut self, index: usize) {
        if index < self.0.len() {
            self.0.remove(index);
        }
    }

    /// Removes all. Returns whether there was any.
    pub fn clear(&mut self) -> bool {
        !std::mem::take(&mut self.0).is_empty()
    }

    /// Lets go what has been shown long enough. Returns whether anything went.
    pub fn expire(&mut self, now: f64) -> bool {
        let before = self.0.len();
        self.0
            .retain(|n| n.weight == NoticeWeight::Warning || now - n.since < INFO_S);
        self.0.len() != before
    }

    /// Seconds until the next one goes by itself.
    pub fn next_expiry(&self, now: f64) -> Option<f64> {
        self.0
            .iter()
            .filter(|n| n.weight == NoticeWeight::Info)
            .map(|n| (n.since + INFO_S - now).max(0.0))
            .min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_stay_and_information_goes() {
        let mut notices = NoticeList::default();
        notices.add("cannot read x.ply", NoticeWeight::Warning, 1.0);
        notices.add("wrote a.png", NoticeWeight::Info, 2.0);
        notices.add("cannot read x.ply", NoticeWeight::Warning, 3.0);
        assert_eq!(notices.list().len(), 2, "the same text once");
        assert_eq!(notices.next_expiry(3.0), Some(INFO_S - 1.0));
        assert!(!notices.expire(7.9) && notices.expire(8.0));
        assert_eq!(notices.next_expiry(8.0), None);
        notices.dismiss(7);
        assert_eq!(notices.list()[0].weight, NoticeWeight::Warning);
        assert!(notices.clear() && !notices.clear());
    }

    #[test]
    fn there_are_never_too_many_nor_too_long_ones() {
        let mut notices = NoticeList::default();
        for i in 0..20 {
            notices.add(
                &format!("{i} {}", "ä".repeat(9999)),
                NoticeWeight::Warning,
                0.0,
            );
        }
        assert_eq!(notices.list().len(), MOST);
        assert!(notices.list()[3].text.starts_with("19 "));
        assert!(notices.list()[0].text.chars().count() <= LONGEST + 1);
    }
}
