// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/aruco_detector.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <opencv2/core.hpp>
#include <opencv2/core/version.hpp>
#include <opencv2/imgproc.hpp>

// OpenCV 4.7 moved the markers from contrib's free functions into classes of objdetect.
#define SIGHTLINE_OPENCV_ARUCO_CLASSES \
  (CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7))
#if SIGHTLINE_OPENCV_ARUCO_CLASSES
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

namespace sightline::observe {
namespace {

struct DictionaryName {
  const char* name;
  int id;
};
constexpr std::array kDictionaries = {
    DictionaryName{"4X4_50", cv::aruco::DICT_4X4_50},
    DictionaryName{"4X4_100", cv::aruco::DICT_4X4_100},
    DictionaryName{"4X4_250", cv::aruco::DICT_4X4_250},
    DictionaryName{"4X4_1000", cv::aruco::DICT_4X4_1000},
    DictionaryName{"5X5_50", cv::aruco::DICT_5X5_50},
    DictionaryName{"5X5_100", cv::aruco::DICT_5X5_100},
    DictionaryName{"5X5_250", cv::aruco::DICT_5X5_250},
    DictionaryName{"5X5_1000", cv::aruco::DICT_5X5_1000},
    DictionaryName{"6X6_50", cv::aruco::DICT_6X6_50},
    DictionaryName{"6X6_100", cv::aruco::DICT_6X6_100},
    DictionaryName{"6X6_250", cv::aruco::DICT_6X6_250},
    DictionaryName{"6X6_1000", cv::aruco::DICT_6X6_1000},
    DictionaryName{"7X7_50", cv::aruco::DICT_7X7_50},
    DictionaryName{"7X7_100", cv::aruco::DICT_7X7_100},
    DictionaryName{"7X7_250", cv::aruco::DICT_7X7_250},
    DictionaryName{"7X7_1000", cv::aruco::DICT_7X7_1000},
    DictionaryName{"ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
};

const DictionaryName* find_dictionary(const std::string& name) {
  for (const DictionaryName& d : kDictionaries) {
    if (name == d.name) return &d;
  }
  return nullptr;
}

/// Two threshold windows find nearly what three do, for two thirds of the time; wider margins
/// around the bits decode small markers better (measured on both board recordings).
template <typename Parameters>
void tune(Parameters& parameters) {
  parameters.adaptiveThreshWinSizeMin = 3;
  parameters.adaptiveThreshWinSizeMax = 13;
  parameters.adaptiveThreshWinSizeStep = 10;
  parameters.perspectiveRemoveIgnoredMarginPerCell = 0.3;
}

/// The one place that knows which OpenCV it is.
class Markers {
 public:
#if SIGHTLINE_OPENCV_ARUCO_CLASSES
  static cv::aruco::Dictionary dictionary(int id) { return cv::aruco::getPredefinedDictionary(id); }
  static void draw(const cv::aruco::Dictionary& dictionary, int id, int side, cv::Mat& image) {
    cv::aruco::generateImageMarker(dictionary, id, side, image);
  }
  explicit Markers(const cv::aruco::Dictionary& dictionary) : detector_(dictionary, tuned()) {}
  void detect(const cv::Mat& image, std::vector<std::vector<cv::Point2f>>& corners,
              std::vector<int>& ids) {
    detector_.detectMarkers(image, corners, ids);
  }

 private:
  static cv::aruco::DetectorParameters tuned() {
    cv::aruco::DetectorParameters parameters;
    tune(parameters);
    return parameters;
  }
  cv::aruco::ArucoDetector detector_;
#else
  static cv::aruco::Dictionary dictionary(int id) {
    return *cv::aruco::getPredefinedDictionary(id);
  }
  static void draw(const cv::aruco::Dictionary& dictionary, int id, int side, cv::Mat& image) {
    cv::aruco::drawMarker(cv::makePtr<cv::aruco::Dictionary>(dictionary), id, side, image);
  }
  explicit Markers(const cv::aruco::Dictionary& dictionary)
      : dictionary_(cv::makePtr<cv::aruco::Dictionary>(dictionary)),
        parameters_(cv::aruco::DetectorParameters::create()) {
    tune(*parameters_);
  }
  void detect(const cv::Mat& image, std::vector<std::vector<cv::Point2f>>& corners,
              std::vector<int>& ids) {
    cv::aruco::detectMarkers(image, dictionary_, corners, ids, parameters_);
  }

 private:
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::DetectorParameters> parameters_;
#endif
};

/// The part of `plane` that a region covers, without a copy.
cv::Mat view(const PlaneView& plane, const Region& r) {
  return cv::Mat(r.height(), r.width(), CV_8UC1, const_cast<uint8_t*>(plane.row(r.top) + r.left),
                 static_cast<size_t>(plane.stride));
}

class ArucoDetector : public SquareDetector {
 public:
  ArucoDetector(const cv::aruco::Dictionary& used, bool inverted)
      : markers_(used), modules_(used.markerSize + 2), inverted_(inverted) {}

  void detect(const Frame& frame, const Region& region, double scale,
              std::vector<SquareDetection>& out) override {
    const double factor = prepare(frame, region, scale);
    const Eigen::Vector2d origin = factor * origin_;
    const Eigen::Vector2d center = Eigen::Vector2d::Constant((factor - 1) / 2);
    corners_.clear();
    ids_.clear();
    try {
      markers_.detect(image_, corners_, ids_);
    } catch (const cv::Exception&) {
      return;  // a degenerate quadrilateral; the frame shows nothing then
    }
    for (size_t i = 0; i < ids_.size(); ++i) {
      SquareDetection detection;
      detection.code = ids_[i];
      for (size_t k = 0; k < 4; ++k) {
        const cv::Point2f p = corners_[i][k];
        detection.corners[k] = origin + center + factor * Eigen::Vector2d(p.x, p.y);
      }
      out.push_back(detection);
    }
  }

  Border border(int) const override { return {modules_, inverted_}; }
  double min_side_px() const override { return 2.5 * modules_; }

 private:
  /// Sets image_ to the region at `scale` and returns full-size pixels per pixel of it.
  double prepare(const Frame& frame, const Region& region, double scale) {
    double factor = 1;
    if (scale > 0.75) {
      origin_ = Eigen::Vector2d(region.left, region.top);
      image_ = view(frame.gray(), region);
    } else {
      factor = 2;
      const PlaneView half = frame.half_gray();
      const Region r{region.left / 2, region.top / 2, std::min(half.width, (region.right + 1) / 2),
                     std::min(half.height, (region.bottom + 1) / 2)};
      origin_ = Eigen::Vector2d(r.left, r.top);
      image_ = view(half, r);
      if (scale < 0.375) {
        factor = 4;
        cv::resize(image_, quarter_, {}, 0.5, 0.5, cv::INTER_AREA);
        image_ = quarter_;
        origin_ *= 0.5;
      }
    }
    if (inverted_) {
      cv::bitwise_not(image_, negative_);
      image_ = negative_;
    }
    return factor;
  }

  Markers markers_;
  int modules_;
  bool inverted_;
  cv::Mat image_, quarter_, negative_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // of image_ in pixels of its own size
  std::vector<std::vector<cv::Point2f>> corners_;
  std::vector<int> ids_;
};

}  // namespace

bool is_aruco_dictionary(const std::string& dictionary) {
  return find_dictionary(dictionary) != nullptr;
}

std::vector<std::string> aruco_dictionaries() {
  std::vector<std::string> names;
  for (const DictionaryName& d : kDictionaries) names.emplace_back(d.name);
  return names;
}

std::string aruco_dictionary_of_family(const std::string& family) {
  for (const DictionaryName& d : kDictionaries) {
    if (aruco_family_of_dictionary(d.name) == family) return d.name;
  }
  return {};
}

std::string aruco_family_of_dictionary(const std::string& dictionary) {
  std::string lower;
  for (char c : dictionary) {
    lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return lower.starts_with("aruco_") ? lower : "aruco_" + lower;
}

Result<std::unique_ptr<SquareDetector>> make_aruco_detector(const std::vector<SquareCode>& codes,
                                                            const std::string& dictionary,
                                                            bool inverted,
                                                            const std::string& where) {
  const DictionaryName* name = find_dictionary(dictionary);
  SL_CHECK(name != nullptr, "the caller checks the dictionary's name");
  try {
    const cv::aruco::Dictionary all = Markers::dictionary(name->id);
    // Only our own codes, so that a foreign marker never costs or confuses.
    cv::Mat used;
    for (const SquareCode& code : codes) {
      if (code.id < 0 || code.id >= all.bytesList.rows) {
        return make_error(ErrorCode::kInvalidInput, where,
                          "dictionary {} has no id {}: it has 0 to {}", dictionary, code.id,
                          all.bytesList.rows - 1);
      }
      used.push_back(all.bytesList.row(code.id));
    }
    const cv::aruco::Dictionary reduced(used, all.markerSize, all.maxCorrectionBits);
    return std::unique_ptr<SquareDetector>(std::make_unique<ArucoDetector>(reduced, inverted));
  } catch (const cv::Exception& e) {
    return make_error(ErrorCode::kInternal, where, "OpenCV could not make dictionary {}: {}",
                      dictionary, e.what());
  }
}

std::vector<bool> aruco_modules(const std::string& dictionary, int id) {
  const DictionaryName* name = find_dictionary(dictionary);
  if (name == nullptr) return {};
  const cv::aruco::Dictionary all = Markers::dictionary(name->id);
  if (id < 0 || id >= all.bytesList.rows) return {};
  cv::Mat image;
  Markers::draw(all, id, all.markerSize + 2, image);
  std::vector<bool> dark;
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      dark.push_back(image.at<uint8_t>(row, column) < 128);
    }
  }
  return dark;
}

}  // namespace sightline::observe
