//! The queue of pairs: cheapest first, but for differences too small to be seen.
//!
//! Pairs lie in bins of a sixteenth of an octave of cost (2 % of a distance) and leave a bin in the order in which they
//! came. That order follows the mesh, so neighbours come soon after each other, and the memory of one is at hand for the
//! next; an exact order jumps about the whole surface and waits for memory most of the time.

/// A pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// One vertex.
    pub a: u32,
    /// The other one.
    pub b: u32,
    /// Whatever the driver wants to know again.
    pub tag: u32,
}

/// Pairs by price.
#[derive(Debug)]
pub struct Queue {
    bins: Vec<Bin>,
    /// No bin before this one has anything.
    open: usize,
}

#[derive(Clone, Debug, Default)]
struct Bin {
    entries: Vec<Entry>,
    /// How many of them are gone.
    done: usize,
}

/// Bits of a cost that its bin does not depend on: four bits of the mantissa are left.
const SHIFT: u32 = 19;

/// The bin of a cost. Costs are not negative, so their bits order as they do.
pub fn bin(cost: f64) -> usize {
    // −0 would order above everything.
    ((cost.max(0.0) as f32 + 0.0).to_bits() >> SHIFT) as usize
}

impl Queue {
    /// An empty queue.
    pub fn new() -> Self {
        Self { bins: vec![Bin::default(); bin(f64::INFINITY) + 1], open: 0 }
    }

    /// Adds a pair.
    #[inline]
    pub fn push(&mut self, a: u32, b: u32, cost: f64, tag: u32) {
        let bin = bin(cost);
        self.open = self.open.min(bin);
        self.bins[bin].entries.push(Entry { a, b, tag });
    }

    /// The next pair.
    #[inline]
    pub fn pop(&mut self) -> Option<Entry> {
        loop {
            let bin = &mut self.bins[self.open];
            if let Some(&entry) = bin.entries.get(bin.done) {
                bin.done += 1;
                return Some(entry);
            }
            *bin = Bin::default();
            if self.open + 1 == self.bins.len() {
                return None;
            }
            self.open += 1;
        }
    }

    /// The pairs that come after the next ones if nothing cheaper is added: `count` of them, or fewer.
    #[inline]
    pub fn ahead(&self, count: usize) -> &[Entry] {
        let bin = &self.bins[self.open];
        &bin.entries[bin.done..(bin.done + count).min(bin.entries.len())]
    }

    /// Whether all pairs cost more than that, or there are none.
    pub fn is_above(&mut self, cost: f64) -> bool {
        let limit = bin(cost);
        while self.open + 1 < self.bins.len() && self.bins[self.open].done == self.bins[self.open].entries.len() {
            if limit < self.open {
                return true;
            }
            self.bins[self.open] = Bin::default();
            self.open += 1;
        }
        limit < self.open
    }

    /// Whether a pair of that cost need not wait.
    #[inline]
    pub fn is_due(&self, cost: f64) -> bool {
        bin(cost) <= self.open
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_come_by_cost_and_in_order_where_costs_are_alike() {
        let mut queue = Queue::new();
        let costs = [3.0, 0.0, 1e-30, 7e20, 1.0, 1.001, -0.0, f64::INFINITY, 2.5, 1.0];
        for (index, &cost) in costs.iter().enumerate() {
            queue.push(index as u32, 99, cost, 7);
        }
        let mut order = Vec::new();
        while let Some(entry) = queue.pop() {
            assert_eq!((entry.b, entry.tag), (99, 7));
            order.push(entry.a);
        }
        assert_eq!(order, [1, 6, 2, 4, 5, 9, 8, 0, 3, 7]);
    }

    #[test]
    fn late_pairs_find_their_place() {
        let mut queue = Queue::new();
        queue.push(0, 1, 1.0, 0);
        queue.push(2, 3, 4.0, 0);
        assert_eq!(queue.pop().map(|entry| entry.a), Some(0));
        assert!(queue.is_due(0.5) && queue.is_due(1.01) && !queue.is_due(1.2));
        // Cheaper than what is open: comes next. Dearer: waits.
        queue.push(4, 5, 0.25, 0);
        queue.push(6, 7, 2.0, 0);
        let left: Vec<u32> = std::iter::from_fn(|| queue.pop()).map(|entry| entry.a).collect();
        assert_eq!(left, [4, 6, 2]);
    }
}
