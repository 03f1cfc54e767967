//! Disjoint sets of numbers: what hangs together with what. The least number of a set stands for it.

/// Sets of the numbers from 0 on.
#[derive(Clone, Debug)]
pub struct Sets(Vec<u32>);

impl Sets {
    /// Each of `count` numbers alone; fewer than 2³².
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The least number of the set of `i`. Halves the path to it.
    pub fn root(&mut self, i: usize) -> usize {
        let parents = &mut self.0;
        let mut i = i as u32;
        while parents[i as usize] != i {
            parents[i as usize] = parents[parents[i as usize] as usize];
            i = parents[i as usize];
        }
        i as usize
    }

    /// Makes the sets of `a` and `b` one.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_stands_for_its_set() {
        let mut sets = Sets::new(6);
        for (a, b) in [(5, 4), (4, 3), (1, 2), (3, 5)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5].map(|i| sets.root(i)), [0, 1, 1, 3, 3, 3]);
        sets.join(2, 4);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|i| sets.root(i)), [0, 1, 1, 1, 1, 1]);
    }
}
