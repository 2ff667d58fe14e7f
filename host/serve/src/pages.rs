//! The pages that ask for states, each by a number that it has given itself.

use std::time::Duration;
use tokio::time::Instant;

/// A page that has not asked for so long is closed or hidden.
const GONE: Duration = Duration::from_secs(3);
/// The most pages that are kept apart; with more, the one that has not asked for longest is forgotten.
const MOST: usize = 64;

/// A page that asks for states.
#[derive(Debug)]
struct Page {
    number: u64,
    asked: Instant,
    /// The number of the image that it got last.
    image: u64,
}

/// The pages that ask for states now.
#[derive(Debug, Default)]
pub struct Pages(Vec<Page>);

impl Pages {
    /// Records that a page gets this image. Returns whether the image is new to the page.
    pub fn gets(&mut self, number: u64, image: u64, now: Instant) -> bool {
        self.forget(now);
        let before = self.0.iter().position(|page| page.number == number);
        let last = before.map_or(0, |at| self.0.remove(at).image);
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(Page { number, asked: now, image });
        image != last
    }

    /// Number of pages.
    pub fn count(&mut self, now: Instant) -> usize {
        self.forget(now);
        self.0.len()
    }

    fn forget(&mut self, now: Instant) {
        self.0.retain(|page| now.saturating_duration_since(page.asked) < GONE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_counts_while_it_asks_and_gets_each_image_once() {
        let (mut pages, start) = (Pages::default(), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        assert!(pages.gets(7, 1, at(0)) && pages.gets(8, 1, at(100)));
        assert!(!pages.gets(7, 1, at(200)) && pages.gets(7, 2, at(2000)));
        assert_eq!(pages.count(at(3000)), 2);
        assert_eq!(pages.count(at(3200)), 1, "page 8 has not asked for 3 s");
        assert_eq!(pages.count(at(5000)), 0);
        for number in 0..1000 {
            pages.gets(number, 1, at(6000));
        }
        assert_eq!(pages.count(at(6000)), MOST);
    }
}
