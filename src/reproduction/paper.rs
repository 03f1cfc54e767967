//! The figures of the instanced-model paper (ITS), as printed, of its bunny.
//!
//! S. Tariq, A. U. Rahman, T. Azim, R. G. Khan, *Instanced model simplification using combined geometric and
//! appearance-related metric*, tables 2 and 3. Times are of that paper's machine and of VB.NET: only their ratios can be
//! held against others.

/// How many percent of the vertices are taken away, in round numbers: [`COUNTS`] has what the paper's levels have.
pub const PERCENTS: [u32; 3] = [10, 20, 50];

/// Copies of the bunny in table 3.
pub const INSTANCES: usize = 13;

/// Vertices and faces of the source.
pub const SOURCE: [usize; 2] = [2503, 4968];

/// Table 2: vertices and faces left, for each of [`PERCENTS`].
pub const COUNTS: [[usize; 2]; 3] = [[2247, 4456], [1998, 3958], [1244, 2448]];

/// Table 3: kilobytes and milliseconds of quadrics, GAPS, IAS and ITS, for each of [`PERCENTS`].
pub const COSTS: [[[u32; 2]; 4]; 3] = [
    [[6383, 10140], [6370, 10517], [4672, 741], [4661, 774]],
    [[5928, 12922], [5915, 12662], [4147, 910], [4142, 977]],
    [[4537, 8125], [4537, 8151], [2594, 602], [2576, 621]],
];
