//! A mesh simplified worse, an asset that grew, one that vanished: each is found, and first.

use super::*;
use crate::budget::tests::scene;
use crate::config::SceneSettings;

fn report(scenes: Vec<SceneRecord>) -> Report {
    Report::new(SceneSettings::default(), scenes, Vec::new())
}

fn between(base: &Report, head: &Report) -> Difference {
    Difference::between(base, head, &Thresholds::default())
}

#[test]
fn an_unchanged_rebuild_reports_nothing() {
    let base = report(vec![scene("a.glb"), scene("b.glb")]);
    let found = between(&base, &base.clone());
    assert_eq!((found.changes.len(), found.unchanged), (0, 2));
    assert_eq!(found.to_text(10), "no change: 2 scenes the same\n");
}

#[test]
fn what_is_below_the_noise_floor_is_no_change() {
    let base = report(vec![scene("a.glb")]);
    let mut noisy = scene("a.glb");
    noisy.meshes[0].levels[1].d_rms = Some(6.0 * 1.029);
    noisy.outputs[0].bytes += 19;
    let found = between(&base, &report(vec![noisy.clone()]));
    assert_eq!((found.changes, found.unchanged), (vec![], 1));
    noisy.meshes[0].levels[1].d_rms = Some(6.0 * 1.031);
    noisy.outputs[0].bytes += 2;
    let kinds: Vec<Kind> = between(&base, &report(vec![noisy])).changes.iter().map(|c| c.kind).collect();
    assert_eq!(kinds, [Kind::Uglier, Kind::Grew]);
}

#[test]
fn planted_regressions_are_found_first() {
    let base = report(vec![scene("a.glb"), scene("b.glb"), scene("c.glb"), scene("d.glb")]);
    let (mut a, mut b, mut d) = (scene("a.glb"), scene("b.glb"), scene("d.glb"));
    a.meshes[0].levels[1].d_rms = Some(9.0);
    b.outputs[0].bytes = 22_400;
    d.meshes[0].levels[0].triangles = 400;
    let found = between(&base, &report(vec![a, b, d]));
    insta::assert_snapshot!(found.to_text(10), @r"
    ! vanished c.glb: the scene is not there any more
    ! uglier a.glb: mesh `shade`, level 2: image difference (d_RMS) +50 %: 6.00 → 9.00
    ! grew b.glb: bytes of the files +12 %: 20.0 kB → 22.4 kB
      shrank d.glb: mesh `shade`, level 1: triangles −20 %: 500 → 400

    in sum                                        before      now
    bytes of the files                           80.0 kB  62.4 kB  −22 %
    bytes of geometry                            60.0 kB  45.0 kB  −25 %
    bytes of textures                            20.0 kB  15.0 kB  −25 %
    triangles of the scene, with every instance   24,000   18,000  −25 %
    draw calls                                        48       36  −25 %
    ");
    let rules: Vec<String> = found.findings().into_iter().map(|f| f.rule).collect();
    assert_eq!(rules, ["regression/vanished", "regression/uglier", "regression/grew"]);
}

#[test]
fn scenes_break_and_meshes_and_levels_come_and_go() {
    let base = report(vec![scene("a.glb"), scene("b.glb")]);
    let (mut a, mut b) = (scene("a.glb"), scene("b.glb"));
    a.status = Status::Failed;
    b.meshes[0].levels.pop();
    b.meshes[1].name = Some("other".into());
    let head = report(vec![a, b, scene("new.glb")]);
    let told: Vec<String> = between(&base, &head)
        .changes
        .iter()
        .filter(|c| c.scene.is_some())
        .map(|c| format!("{:?} {}", c.kind, c.place()))
        .collect();
    insta::assert_snapshot!(told.join("\n"), @r"
    Broke a.glb
    Vanished b.glb: mesh `shade`, level 2
    Vanished b.glb: mesh `twin`
    Appeared b.glb: mesh `other`
    Appeared new.glb
    ");
    let back: Vec<Kind> = between(&head, &base).changes.iter().filter(|c| c.scene.is_some()).map(|c| c.kind).collect();
    assert!(back.contains(&Kind::Mended) && back.contains(&Kind::Vanished), "{back:?}");
    let lenient = Thresholds { may_vanish: true, ..Thresholds::default() };
    assert!(
        Difference::between(&head, &base, &lenient)
            .changes
            .iter()
            .all(|c| c.kind != Kind::Vanished || !c.is_regression)
    );
}
