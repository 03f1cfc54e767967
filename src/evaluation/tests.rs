//! A square against itself, a smaller and a shifted one.

use super::*;
use crate::appearance::render::Cpu;
use std::fmt::Write;
use std::path::Path;

/// A unit square in z = 0 with texture coordinates, `side` long and moved by `x`.
fn square(folder: &Path, name: &str, side: f32, x: f32) -> Subject {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut text = String::new();
    for [u, v] in corners {
        writeln!(text, "v {} {} 0\nvt {u} {v}", u * side + x, v * side).unwrap();
    }
    text += "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    Subject::load(path.to_str().unwrap()).unwrap()
}

fn evaluate(reference: &Subject, candidate: &Subject) -> Evaluation {
    let evaluator = Evaluator::new(&Cpu, reference, Options { size: 64, samples: 2000 }).unwrap();
    let found = evaluator.candidate(candidate).unwrap();
    evaluator.record("cpu", vec![found])
}

#[test]
fn identity_is_exactly_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let square = square(folder.path(), "a.obj", 1.0, 0.0);
    let found = &evaluate(&square, &square).candidates[0];
    assert_eq!((found.d_rms, found.silhouette, found.ssim), (0.0, 0.0, 1.0));
    assert!(found.views.iter().all(|&view| view == 0.0) && found.views.len() == 24);
    assert!(found.surface.unwrap().max() < 1e-9);
    assert!(found.texture.unwrap().distances.max < 1e-6);
}

#[test]
fn a_shifted_square_is_as_far_off_as_it_was_shifted() {
    let folder = tempfile::tempdir().unwrap();
    let (reference, moved) = (square(folder.path(), "a.obj", 1.0, 0.0), square(folder.path(), "b.obj", 1.0, 0.25));
    let evaluation = evaluate(&reference, &moved);
    let found = &evaluation.candidates[0];
    assert!(found.d_rms > 1.0 && found.silhouette > 0.2 && found.ssim < 0.99, "{found:?}");
    assert!((found.surface.unwrap().max() - 0.25).abs() < 0.01, "{found:?}");
    assert!((found.texture.unwrap().distances.rms - 0.25).abs() < 1e-3, "{found:?}");
    assert!((evaluation.radius - 0.5_f64.sqrt()).abs() < 1e-6);
    assert_eq!((found.facts.triangles, found.facts.vertices), (2, 6));
    assert!((found.facts.stretch.unwrap().l2 - 1.0).abs() < 1e-6);
}

#[test]
fn the_text_fits_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let (reference, small) = (square(folder.path(), "a.obj", 1.0, 0.0), square(folder.path(), "b.obj", 0.9, 0.0));
    let mut evaluation = evaluate(&reference, &small);
    evaluation.reference.name = "lamp.glb".to_owned();
    evaluation.candidates[0].facts.name = "out/lamp.glb@2".to_owned();
    evaluation.candidates[0].facts.notes = vec!["images[0]: there is no file `lamp.png`".to_owned()];
    let text = evaluation.to_text();
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert!(text.contains("out/lamp.glb@2: images[0]"), "{text}");
}

#[test]
fn it_obeys_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    let square = square(folder.path(), "a.obj", 1.0, 0.0);
    let json = serde_json::to_value(evaluate(&square, &square)).unwrap();
    let validator = jsonschema::validator_for(&schema()).unwrap();
    assert!(validator.is_valid(&json), "{:?}", validator.iter_errors(&json).map(|e| e.to_string()).collect::<Vec<_>>());
    assert_eq!(serde_json::from_value::<Evaluation>(json).unwrap().candidates.len(), 1);
}

#[test]
fn what_cannot_be_shown_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\n").unwrap();
    let error = Subject::load(path.to_str().unwrap()).unwrap_err();
    assert!(!error.to_string().is_empty());
    assert!(Subject::load("no such file.glb").unwrap_err().to_string().contains("no such file"));
}
