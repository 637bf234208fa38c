// SPDX-License-Identifier: Apache-2.0
#include "observe/track/model_tracker.hpp"

#include <array>
#include <cmath>
#include <utility>

#include "observe/terms/image_colors.hpp"
#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

ModelTracker::ModelTracker(const TrackerCamera& camera, const TrackedObject& object)
    : camera_(camera),
      object_(object),
      outline_(camera, *object.views),
      other_outline_(camera, *object.views),
      fit_(camera),
      region_(camera),
      edges_(camera),
      texture_(camera, {camera.options.texture_error}),
      print_measurement_(camera, {camera.options.print_error, kPrintRounds, kTexturedPoints}) {
  if (object.print) print_ = std::make_unique<PrintPoints>(camera.camera->model, object.print);
}

// By the object's colors as a whole.
OutlineAgreement ModelTracker::by_all_colors(const Look& look, const ColorHistograms* known) {
  outline_.place(look.prior.world_from_object);
  const ColorHistograms* const colors =
      fit_.fit(ColorReader(look.frame.i420()), look.prior, look.spread_px, known, outline_);
  if (colors == nullptr) return {};
  return region_.judge(look.prior, colors->separation(), outline_);
}

// By the colors of each stretch of its outline. Some that differ are found almost anywhere, so that
// they only say where the outline is; that it is one, its edges have to say. What is printed beside
// the outline can mislead colors that are read while it is some pixels off: then the edges move it
// first.
OutlineAgreement ModelTracker::by_local_colors(const Look& look, const LocalColors* known) {
  outline_.place(look.prior.world_from_object);
  const OutlineAgreement by_colors = judge_locally(look, look.spread_px, known);
  if (by_colors.seen) return by_colors;
  outline_.place(look.prior.world_from_object);
  edges_.pull(look.frame.gray(), look.prior, outline_);
  return judge_locally(look, 0, known);
}

OutlineAgreement ModelTracker::judge_locally(const Look& look, double spread_px,
                                             const LocalColors* known) {
  if (!fit_.fit_locally(ColorReader(look.frame.i420()), look.prior, spread_px,
                        known != nullptr ? *known : nothing_local_, outline_)) {
    return {};
  }
  OutlineAgreement agreement = region_.judge(look.prior, 1.0, outline_);
  agreement.local = true;
  if (!agreement.seen) return agreement;
  const EdgeSupport edges = edges_.support(look.frame.gray(), look.prior, outline_, agreement);
  agreement.edge_support = edges.share();
  agreement.seen = agreement.edge_support >= kMinEdgeSupport &&
                   agreement.edge_support * agreement.evidence >= kMinLocalScore;
  return agreement;
}

OutlineAgreement ModelTracker::find_outline(const Look& look, const ColorHistograms* known,
                                            const LocalColors* known_local, bool from_detection) {
  const bool held_locally = known_local != nullptr && known_local->known();
  if (held_locally) {
    const OutlineAgreement local = by_local_colors(look, known_local);
    if (local.seen) return local;
  }
  OutlineAgreement all = by_all_colors(look, known);
  if (all.seen && all.evidence >= kClearEvidence) return all;
  if (all.seen) {
    all.edge_support = edges_.support(look.frame.gray(), look.prior, outline_, all).share();
  }
  // What was found may be something else: colors that do not tell clearly fit where they were read,
  // whatever is there. From afar an outline gets to something else more often. Of what was held by
  // the colors of its stretches, those as a whole are known not to tell.
  const I420View image = look.frame.i420();
  const bool in_color = has_colors(image.u, image.v);
  if (from_detection || look.from_afar || held_locally || !in_color) {
    const double least = look.from_afar && held_locally ? kAfarEdgeSupport : kHeldEdgeSupport;
    all.seen = all.seen && all.edge_support >= least;
  }
  if (held_locally) return all;
  std::swap(outline_, other_outline_);
  const OutlineAgreement local = by_local_colors(look, known_local);
  const double margin = in_color ? kClearEdgeMargin : 0;
  const double rival = all.seen ? all.edge_support + margin : 0;
  if (local.seen && local.edge_support >= rival) return local;
  std::swap(outline_, other_outline_);
  return all;
}

bool ModelTracker::print_missing() const {
  if (!print_) return false;
  const bool expected = print_->tried() >= size_t{kTexturedPoints};
  return print_->given_up() || (expected && print_measurement_.found().size() < kLeadingPoints);
}

bool print_in_place(const ObjectTracker::TrackResult& result) {
  return result.by_print && result.points_used >= kTexturedPoints;
}

size_t ModelTracker::aspect() const {
  const Rigid3 object_from_camera = outline_.camera_from_object().inverse();
  return Appearance::aspect_of(
      (object_from_camera.translation - object_.views->center()).normalized());
}

size_t ModelTracker::place(const Rigid3& world_from_object,
                           std::span<const OccludingSphere> spheres) {
  outline_.set_occluders(spheres);
  outline_.place(world_from_object);
  return aspect();
}

ModelTracker::Measurement ModelTracker::measure(const Frame& frame, const Prediction& prediction,
                                                const Learned& learned,
                                                std::span<const OccludingSphere> spheres,
                                                std::vector<PoseTermPtr>& terms) {
  const TrackerOptions& options = camera_.options;
  const PosePrior prior(prediction.world_from_object, prediction.covariance,
                        options.placing_floor.rotation, options.placing_floor.translation);
  for (PlacedOutline* outline : {&outline_, &other_outline_}) {
    outline->set_occluders(spheres);
    outline->set_motion(prediction.world_from_object, prediction.twist);
  }
  outline_.place(prediction.world_from_object);
  Measurement out;
  out.aspect = aspect();
  ObjectTracker::TrackResult& result = out.result;
  result.lines_total = static_cast<int>(outline_.lines().size());
  if (outline_.lines().empty()) return out;

  const Matrix6& covariance = prediction.covariance;
  const double sigma_rotation = std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3);
  const double sigma_translation = std::sqrt(covariance.bottomRightCorner<3, 3>().trace() / 3);
  const double radius = object_.views->radius();
  const double spread = sigma_translation + radius * sigma_rotation;
  const ColorHistograms* known =
      learned.colors != nullptr ? learned.colors->of_aspect(out.aspect) : nullptr;
  const OutlineAgreement agreement = find_outline(
      {frame, prior, outline_.pixels_per_meter() * spread, spread > kAfarRadii * radius}, known,
      learned.local, learned.from_detection);
  result.lines_total = static_cast<int>(outline_.lines().size());
  result.lines_used = agreement.lines_used;
  result.evidence = agreement.evidence;
  result.separation = agreement.separation;
  result.noise_px = agreement.noise_px;
  result.local_colors = agreement.local;
  result.edge_support = agreement.edge_support;
  result.seen = agreement.seen;
  if (result.seen) {
    make_terms(frame, prior, prediction, agreement, learned.texture, out, terms);
    return out;
  }
  // Its outline may be covered, by a hand for instance.
  const Rigid3& pose = prediction.world_from_object;
  PoseTermPtr print = measure_print(frame, prior, {&pose, 1}, prediction.ambiguous, result);
  if (print_in_place(result)) {
    out.fitted = print_measurement_.pose();
    result.seen = result.by_print_alone = true;
    terms.push_back(std::move(print));
  }
  return out;
}

PoseTermPtr ModelTracker::measure_print(const Frame& frame, const PosePrior& prior,
                                        std::span<const Rigid3> starts, bool ambiguous,
                                        ObjectTracker::TrackResult& result) {
  if (!print_) return nullptr;
  TexturePoints& points = print_->around(camera_.camera_from_world * starts.front());
  PoseTermPtr term = print_measurement_.measure(frame.gray(), prior, starts, outline_.occluders(),
                                                ambiguous, points, result.points_used,
                                                outline_.rolling() ? &outline_ : nullptr);
  result.by_print = term != nullptr;
  return term;
}

void ModelTracker::make_terms(const Frame& frame, const PosePrior& prior,
                              const Prediction& prediction, const OutlineAgreement& agreement,
                              TexturePoints* texture, Measurement& out,
                              std::vector<PoseTermPtr>& terms) {
  ObjectTracker::TrackResult& result = out.result;
  out.fitted = outline_.pose() * Rigid3::exp(agreement.step);
  // Where something of its color is beside it, an outline is farther off than a print is looked
  // for.
  const std::array starts{out.fitted, prediction.world_from_object};
  PoseTermPtr points = measure_print(frame, prior, starts, prediction.ambiguous, result);
  if (!points && texture != nullptr) {
    points = texture_.measure(frame.gray(), prior, {&out.fitted, 1}, outline_.occluders(),
                              prediction.ambiguous, *texture, result.points_used);
  }
  if (points) terms.push_back(std::move(points));
  // Where the print is in place, the outline adds its own errors only: a white rim before a white
  // wall pulls it by pixels.
  const bool placed = print_in_place(result);
  if (placed) out.fitted = print_measurement_.pose();
  if (object_.modalities.region && !placed) {
    OutlineAgreement doubted = agreement;
    if (print_ && print_->tried() >= size_t{kTexturedPoints}) doubted.scale *= kOutlineWithoutPrint;
    terms.push_back(region_.term(outline_, doubted));
  }
  // On a textured object most steps of brightness are texture.
  if (object_.modalities.edge && result.points_used < kTexturedPoints) {
    const EdgeResult edges = edges_.measure(frame.gray(), prior, outline_, agreement, terms);
    result.edges_used = edges.used;
    result.edge_noise_px = edges.noise_px;
  }
}

}  // namespace sightline::observe
