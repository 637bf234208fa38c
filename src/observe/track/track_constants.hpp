// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

/// Tuned constants of the trackers that stand for no physical quantity of an installation (those
/// are TrackerOptions). Chosen on recordings/bench (pose errors per modality and camera) and on the
/// rendered conditions of bench/tracking; docs/tracking.md has the figures.
namespace sightline::observe::tuning {

// Placing lines.
constexpr double kBorderPx = 2;        // that a line keeps from the image's border
constexpr double kOffsetsSpan = 7.5;   // segments that measure_lines() tries to either side
constexpr double kSpreadSigmas = 2.0;  // of the prediction that the coarsest pass covers
constexpr int kMaxScale = 8;           // pixels of a segment in the coarsest pass
// Neighboring pixels share noise and clutter, so a posterior is surer than it should be.
constexpr double kPlacingInflation = 2.0;
// From afar many lines find something else, or nothing: nearly the least sum of absolute
// deviations [sigma], in up to so many passes with segments of one length.
constexpr double kPlacingHuber = 0.1;
constexpr int kPlacingPasses = 4;

// Measuring lines by color: the smoothed step of Stoiber et al. (SRT3D), and the pixels whose
// evidence and luma say what is on either side.
constexpr double kStepAmplitude = 0.40;
constexpr double kStepSlope = 0.6;  // [segments]
constexpr int kEvidenceReach = 8;   // [segments] beside the outline
constexpr double kEvidenceGap = 1;  // [segments]

// Occlusion by the static scene.
constexpr double kFrontTolerance = 0.01;  // share of the range by which an occluder must be nearer
constexpr double kOccluderMarginPx = 3;

// Learning colors.
constexpr double kLearnGapPx = 1.5;   // next to the outline that is left out
constexpr double kMaxLearnGapPx = 6;  // ... while the outline is uncertain
constexpr double kLearnReachPx = 16;  // of either side
constexpr double kInitialRate = 0.3;  // per frame, from where it was found until it is tracked
constexpr int kBlindFrames = 5;       // in a row that a camera misses what the others see, after
                                      // which its colors count as no longer true

// Colors by stretch of the outline. Chosen on recordings started at the truth, 19 in color and 13
// turned gray (docs/tracking.md).
constexpr double kClearEvidence = 0.6;    // of the colors as a whole, that is enough alone
constexpr double kMinEdgeSupport = 0.3;   // of an outline that was found by local colors
constexpr double kMinLocalScore = 0.15;   // its edge support times its evidence
constexpr double kClearEdgeMargin = 0.2;  // over what the colors as a whole found
constexpr double kAfarEdgeSupport = 0.5;  // of one that those as a whole found from afar
constexpr double kHeldEdgeSupport = 0.3;  // of what those found where they cannot be trusted alone
constexpr double kAfarRadii = 0.3;        // of the object, that a prediction may be off
constexpr int kMinCellPixels = 40;        // of either side, to say anything
constexpr float kFreshLocalShare = 0.5f;  // of the frame at hand, in what is beside the object
constexpr float kRareLocalColor = 0.02f;  // share below which a color says little

// An estimate that rotates more than this from one frame to the next was moved to another pose
// that the shape cannot tell from it [rad].
constexpr double kSymmetricJump = 0.7;

// Agreement of the outline.
constexpr double kOutlierSigmas = 3.0;  // of lines that are not handed out
constexpr double kLineEvidence = 0.15;  // (inside - outside) / 2 of a line that counts

// Edges.
constexpr float kRivalStepShare = 0.4f;  // of the strongest step that another one must have
constexpr double kMinEdgeReachPx = 1.5;  // of a line that is searched at all
constexpr double kMinEdgeShare = 0.55;   // of lines with a step that must agree
constexpr double kEdgeAgreesPx = 1.0;    // between the strongest step and the pose
constexpr size_t kMinEdges = 16;
constexpr int kEdgeRounds = 2;          // of choosing the nearest step
constexpr int kPullRounds = 3;          // of moving an outline to its edges alone
constexpr double kOutlineSigmas = 2.0;  // of a line, within which a step of the outline counts
constexpr double kMaxEdgeBiasPx = 0.5;  // between color and brightness, median
constexpr double kSamePixels = 0.5;     // share of an outline's pixels that its edges count for

// Texture.
constexpr int kMaxIterations = 8;
constexpr double kConvergedPx = 0.02;
constexpr double kMaxShiftPx = 4.0;            // from where it was expected
constexpr float kMinPatchCorrelation = 0.85f;  // normalized
constexpr double kMinCosine = 0.35;            // between surface normal and view
constexpr double kMinSameAspect = 0.80;        // cosine between the views then and now
constexpr int kMaxMisses = 20;                 // searches in a row that do not find it
constexpr double kPointSpacingPx = 7;
constexpr float kMinCornerStrength = 60.0f;  // least eigenvalue of the mean gradient squares
constexpr size_t kMaxCandidates = 24;
constexpr int kCornerGrid = 2;                         // [px] on which corners are searched
constexpr int kShortestPause = 1, kLongestPause = 48;  // [frames] between searches for corners
constexpr int kRestAfterDrop = 2;                      // [frames]
constexpr size_t kMinPoints = 8;
constexpr size_t kLeadingPoints = 4;  // that a print is looked for once more from where they lead
constexpr int kPrintRounds = 6;
constexpr size_t kMostPoints = 7;  // of ten that are tried, with which it is not
// From so many points on edges are not used, nor, beside a print, the outline.
constexpr int kTexturedPoints = 12;
// Sigma of an outline whose print should be seen and is not in place: a hand is there, or it is not
// its outline.
constexpr double kOutlineWithoutPrint = 4;
constexpr double kPrintRefuted = 0.25;  // correlation of a print that is not there
// Points of the mesh's own print: of another camera, light and printer than the image.
constexpr float kMinPrintCorrelation = 0.75f;
constexpr float kMinPrintStrength = 10.0f;  // of its corners; a rendered image has no noise
constexpr double kPrintTurn = 0.25, kPrintZoom = 0.2;  // [rad], of the log of distances
constexpr size_t kTellingPoints = 10;  // found, for texture to tell symmetric poses apart
constexpr double kPointLogLikelihood = 0.5;

}  // namespace sightline::observe::tuning
