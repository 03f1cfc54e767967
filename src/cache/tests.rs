//! What is put is found again, and nothing else ever is.

use std::fs::{self, File};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use super::*;

const DAY: Duration = Duration::from_secs(24 * 60 * 60);

fn key(byte: u8) -> JobKey {
    JobKey([byte; 32])
}

fn hit(cache: &Cache, bucket: Bucket, key: &JobKey) -> Option<Vec<u8>> {
    match cache.get(bucket, key) {
        Lookup::Hit(bytes) => Some(bytes),
        Lookup::Miss => None,
        Lookup::Damaged(warning) => panic!("{warning}"),
    }
}

fn file_of(cache: &Cache, bucket: Bucket, key: &JobKey) -> PathBuf {
    cache.folder().join(entry::relative_path(bucket, key))
}

/// All files, by path from the cache folder.
fn files(cache: &Cache) -> Vec<String> {
    let mut files = Vec::new();
    let mut open = vec![cache.folder().to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    files.iter().map(|path| path.strip_prefix(cache.folder()).unwrap().display().to_string()).collect()
}

fn set_used(cache: &Cache, bucket: Bucket, key: &JobKey, used: SystemTime) {
    File::options().write(true).open(file_of(cache, bucket, key)).unwrap().set_modified(used).unwrap();
}

fn used(cache: &Cache, bucket: Bucket, key: &JobKey) -> SystemTime {
    fs::metadata(file_of(cache, bucket, key)).unwrap().modified().unwrap()
}

#[test]
fn what_is_put_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(&folder.path().join("deep/cache"));
    assert_eq!(hit(&cache, Bucket::Chains, &key(1)), None);
    assert!(!cache.folder().exists(), "a look-up makes no folder");
    let large: Vec<u8> = (0..3_000_000_u32).map(|i| i as u8).collect();
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    cache.put(Bucket::Sequences, &key(1), b"").unwrap();
    cache.put(Bucket::Sequences, &key(2), &large).unwrap();
    for cache in [&cache, &Cache::open(cache.folder())] {
        assert_eq!(hit(cache, Bucket::Chains, &key(1)).unwrap(), b"one");
        assert_eq!(hit(cache, Bucket::Sequences, &key(1)).unwrap(), b"");
        assert_eq!(hit(cache, Bucket::Sequences, &key(2)).unwrap(), large);
        assert_eq!(hit(cache, Bucket::Chains, &key(2)), None);
    }
    let rest = |byte: &str| byte.repeat(31);
    let expected = [
        ".gitignore".to_owned(),
        "CACHEDIR.TAG".to_owned(),
        format!("chains-v2/01/{}.bin", rest("01")),
        "lock".to_owned(),
        format!("sequences-v1/01/{}.bin", rest("01")),
        format!("sequences-v1/02/{}.bin", rest("02")),
    ];
    assert_eq!(files(&cache), expected);
    let tag = fs::read_to_string(cache.folder().join("CACHEDIR.TAG")).unwrap();
    assert!(tag.starts_with("Signature: 8a477f597d28d172789f06886806bc55"));
}

#[test]
fn damaged_entries_are_misses_with_a_warning() {
    let cache = Cache::temporary().unwrap();
    cache.put(Bucket::Chains, &key(1), b"some bytes").unwrap();
    let file = file_of(&cache, Bucket::Chains, &key(1));
    let good = fs::read(&file).unwrap();
    let check = |bytes: &[u8], expected: Damage| {
        fs::write(&file, bytes).unwrap();
        match cache.get(Bucket::Chains, &key(1)) {
            Lookup::Damaged(CacheWarning::Damaged { cause, .. }) => assert_eq!(cause, expected),
            other => panic!("{other:?}"),
        }
    };
    for cut in 0..good.len() {
        check(&good[..cut], Damage::Length);
    }
    check(&[good.as_slice(), b"x"].concat(), Damage::Length);
    for (at, expected) in (0..good.len()).map(|at| match at {
        0..16 => (at, Damage::Foreign),
        16..48 => (at, Damage::OtherKey),
        48..56 => (at, Damage::Length),
        _ => (at, Damage::Hash),
    }) {
        let mut flipped = good.clone();
        flipped[at] ^= 0x80;
        check(&flipped, expected);
    }
    let Lookup::Damaged(warning) = cache.get(Bucket::Chains, &key(1)) else { panic!("still damaged") };
    let told = warning.to_string().replace(&cache.folder().display().to_string(), "[CACHE]");
    insta::assert_snapshot!(told.replace('\\', "/"), @"cache entry `[CACHE]/chains-v2/01/01010101010101010101010101010101010101010101010101010101010101.bin` is damaged: its hash is wrong; it is computed again");
    cache.put(Bucket::Chains, &key(1), b"some bytes").unwrap();
    assert_eq!(hit(&cache, Bucket::Chains, &key(1)).unwrap(), b"some bytes", "a put mends it");
}

/// A writer that is killed has made at most a temporary file: here, one that was written halfway.
#[test]
fn a_killed_writer_leaves_nothing_that_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path());
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    let file = file_of(&cache, Bucket::Chains, &key(2));
    let half = file.with_file_name(".tmp-abcdef");
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&half, b"lodbake en").unwrap();
    assert_eq!(hit(&cache, Bucket::Chains, &key(2)), None);
    assert_eq!(Stats::of(folder.path()).unwrap().unfinished, 1);
    drop(cache); // the lock goes with the process that holds it
    let upkeep = Upkeep::begin(folder.path()).unwrap();
    assert_eq!(upkeep.verify().unwrap(), Verified { entries: 1, bytes: 91, damaged: vec![] }, "it is no entry");
    assert_eq!(upkeep.collect(None, None, SystemTime::now()).unwrap(), Removed { entries: 1, bytes: 10 });
    assert!(!half.exists());
}

#[test]
fn upkeep_waits_for_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path());
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    let refused = Upkeep::begin(folder.path()).unwrap_err().to_string();
    assert!(refused.ends_with("is in use by another lodbake"), "{refused}");
    let second = Cache::open(folder.path());
    drop(cache);
    assert!(Upkeep::begin(folder.path()).is_err(), "whoever opens a cache that is there uses it");
    drop(second);
    assert!(Upkeep::begin(folder.path()).is_ok());
}

#[test]
fn many_writers_of_one_key_agree() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = vec![7; 100_000];
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                let cache = Cache::open(folder.path());
                for _ in 0..20 {
                    cache.put(Bucket::Chains, &key(1), &bytes).unwrap();
                    assert_eq!(hit(&cache, Bucket::Chains, &key(1)).unwrap(), bytes);
                }
            });
        }
    });
    let cache = Cache::open(folder.path());
    assert_eq!(hit(&cache, Bucket::Chains, &key(1)).unwrap(), bytes);
    assert_eq!(Stats::of(folder.path()).unwrap().unfinished, 0);
    assert_eq!(Stats::of(folder.path()).unwrap().buckets[0].entries, 1);
}

#[test]
fn a_cache_that_cannot_store_warns_once_and_still_reads() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path());
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    fs::write(folder.path().join("sequences-v1"), b"a file where the folder should be").unwrap();
    let warning = cache.put(Bucket::Sequences, &key(2), b"two").unwrap_err().to_string();
    assert!(warning.starts_with("failed to store results in the cache `"), "{warning}");
    cache.put(Bucket::Sequences, &key(3), b"three").expect("told once");
    assert_eq!(hit(&cache, Bucket::Sequences, &key(2)), None);
    assert_eq!(hit(&cache, Bucket::Chains, &key(1)).unwrap(), b"one");
    let nowhere = Cache::open(&folder.path().join("sequences-v1/below a file"));
    assert_eq!(hit(&nowhere, Bucket::Chains, &key(1)), None);
    assert!(nowhere.put(Bucket::Chains, &key(1), b"one").is_err());
    assert!(nowhere.put(Bucket::Chains, &key(1), b"one").is_ok());
}

#[test]
fn a_temporary_cache_goes_with_its_owner() {
    let cache = Cache::temporary().unwrap();
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    assert_eq!(hit(&cache, Bucket::Chains, &key(1)).unwrap(), b"one");
    let folder = cache.folder().to_path_buf();
    drop(cache);
    assert!(!folder.exists());
}

#[test]
fn a_hit_renews_the_time_of_use_once_a_day() {
    let cache = Cache::temporary().unwrap();
    cache.put(Bucket::Chains, &key(1), b"one").unwrap();
    let recent = SystemTime::now() - DAY / 2;
    set_used(&cache, Bucket::Chains, &key(1), recent);
    hit(&cache, Bucket::Chains, &key(1)).unwrap();
    assert_eq!(used(&cache, Bucket::Chains, &key(1)), recent);
    set_used(&cache, Bucket::Chains, &key(1), SystemTime::now() - DAY * 2);
    hit(&cache, Bucket::Chains, &key(1)).unwrap();
    assert!(used(&cache, Bucket::Chains, &key(1)) > recent);
}

/// Four entries of 104 bytes, used 0, 1, 2 and 3 days ago.
fn aged() -> (tempfile::TempDir, SystemTime) {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path());
    let now = SystemTime::now();
    for age in 0..4_u8 {
        let bucket = if age % 2 == 0 { Bucket::Chains } else { Bucket::Sequences };
        cache.put(bucket, &key(age), &[age; 16]).unwrap();
        set_used(&cache, bucket, &key(age), now - DAY * age.into());
    }
    (folder, now)
}

fn left(folder: &tempfile::TempDir) -> Vec<u8> {
    let cache = Cache::open(folder.path());
    let has = |age: &u8| Bucket::ALL.iter().any(|&bucket| hit(&cache, bucket, &key(*age)).is_some());
    (0..4).filter(has).collect()
}

#[test]
fn collection_takes_the_longest_unused_first() {
    let (folder, now) = aged();
    let collect = |bytes: Option<u64>, age: Option<Duration>| {
        Upkeep::begin(folder.path()).unwrap().collect(bytes, age, now).unwrap()
    };
    assert_eq!(collect(None, None), Removed::default());
    assert_eq!(collect(Some(416), Some(DAY * 3)), Removed::default());
    assert_eq!(collect(None, Some(DAY * 5 / 2)), Removed { entries: 1, bytes: 104 });
    assert_eq!(left(&folder), [0, 1, 2]);
    set_used(&Cache::open(folder.path()), Bucket::Chains, &key(2), now - DAY * 2);
    assert_eq!(collect(Some(300), None), Removed { entries: 1, bytes: 104 });
    assert_eq!(left(&folder), [0, 1]);
    assert_eq!(collect(Some(0), None), Removed { entries: 2, bytes: 208 });
}

#[test]
fn upkeep_touches_only_what_the_cache_made() {
    let (folder, now) = aged();
    let at = |name: &str| folder.path().join(name);
    for file in ["mine.txt", "index-v1/a.bin", "chains-v0/old.bin", "chains-value/x", "photos-v1/y"] {
        fs::create_dir_all(at(file).parent().unwrap()).unwrap();
        fs::write(at(file), "12345").unwrap();
    }
    let stats = Stats::of(folder.path()).unwrap();
    let told: Vec<_> = stats.buckets.iter().map(|b| (b.name.as_str(), b.entries, b.bytes)).collect();
    assert_eq!(told, [("chains-v0", 1, 5), ("chains-v2", 2, 208), ("index-v1", 1, 5), ("sequences-v1", 2, 208)]);
    assert_eq!(stats.bytes(), 426);
    Upkeep::begin(folder.path()).unwrap().collect(Some(0), None, now).unwrap();
    assert!(at("index-v1/a.bin").exists() && !at("chains-v0/old.bin").exists());
    assert_eq!(Upkeep::begin(folder.path()).unwrap().clean().unwrap(), Removed { entries: 1, bytes: 5 });
    let mut names: Vec<_> =
        fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["chains-value", "mine.txt", "photos-v1"]);
    let nowhere = at("nowhere");
    assert_eq!(Upkeep::begin(&nowhere).unwrap().clean().unwrap(), Removed::default());
    assert_eq!(Stats::of(&nowhere).unwrap(), Stats::default());
}

#[test]
fn verify_removes_what_is_damaged() {
    let (folder, _) = aged();
    let broken = folder.path().join(entry::relative_path(Bucket::Sequences, &key(1)));
    let moved = folder.path().join(entry::relative_path(Bucket::Sequences, &key(9)));
    fs::write(&broken, b"short").unwrap();
    fs::create_dir_all(moved.parent().unwrap()).unwrap();
    fs::copy(folder.path().join(entry::relative_path(Bucket::Sequences, &key(3))), &moved).unwrap();
    let upkeep = Upkeep::begin(folder.path()).unwrap();
    let verified = upkeep.verify().unwrap();
    assert_eq!((verified.entries, verified.bytes), (3, 312));
    assert_eq!(verified.damaged, [(broken, Damage::Length), (moved, Damage::OtherKey)]);
    assert!(upkeep.verify().unwrap().damaged.is_empty());
}
