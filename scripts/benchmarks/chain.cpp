// From beams to the markers of the map as a C++ programmer would write it, with PCL's rules for outliers and the thesis's
// for blocks. Reads the beams from the file named: 16 doubles of T_target_sonar by rows, angle and range resolution, the
// number of bins (int32, of which 0 ends a scan) and the strengths (uint8). Prints seconds of CPU for each stage, summed
// over all scans, and how many points and blocks were left at the end.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <numeric>
#include <string>
#include <unordered_map>
#include <vector>

struct Point { float x, y, z, padding, strength, more[3]; };
using Cloud = std::vector<Point>;
struct Beam { double pose[16], angle, resolution; std::vector<uint8_t> strengths; };

const double MIN_RANGE = 0.5, HEIGHT_LIMIT = 100.0, RESOLUTION = 0.5, OTSU_MULTIPLIER = 1.4, DEVIATIONS = 1.0;
const int NEIGHBORS = 20, LEAF_POINTS = 16;

static double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

static Cloud projected(const std::vector<Beam>& beams) {
  Cloud cloud;
  for (const Beam& beam : beams) {
    const double c = std::cos(beam.angle), s = std::sin(beam.angle);
    const double* T = beam.pose;
    const double dx = T[0] * c + T[1] * s, dy = T[4] * c + T[5] * s, dz = T[8] * c + T[9] * s;
    for (size_t bin = 0; bin < beam.strengths.size(); bin++) {
      const double range = (bin + 0.5) * beam.resolution;
      const Point point = {float(dx * range + T[3]), float(dy * range + T[7]), float(dz * range + T[11]), 1.0f,
                           float(beam.strengths[bin]), {0.0f, 0.0f, 0.0f}};
      if (range < MIN_RANGE || point.z > HEIGHT_LIMIT) continue;
      cloud.push_back(point);
    }
  }
  return cloud;
}

static double otsu(const std::vector<Point>& points) {
  long histogram[256] = {0}, total = 0, below = 0;
  for (const Point& point : points) {
    if (point.strength > 0.0f) histogram[std::min(int(point.strength), 255)]++;
  }
  double sum = 0.0, sum_below = 0.0, greatest = -1.0;
  for (int level = 0; level < 256; level++) {
    sum += double(level) * histogram[level];
    total += histogram[level];
  }
  int first = 0, last = 0;
  for (int level = 0; level < 256; level++) {
    below += histogram[level];
    sum_below += double(level) * histogram[level];
    const long above = total - below;
    if (below == 0 || above == 0) continue;
    const double difference = sum_below / below - (sum - sum_below) / above;
    const double between = double(below) * above * difference * difference;
    if (between > greatest) { greatest = between; first = level; }
    if (between >= greatest) last = level;
  }
  return (first + last) / 2.0;
}

static Cloud thresholded(const Cloud& cloud) {
  const double threshold = OTSU_MULTIPLIER * otsu(cloud);
  Cloud strong;
  for (const Point& point : cloud) {
    if (point.strength > threshold) strong.push_back(point);
  }
  return strong;
}

// A k-d tree as FLANN's: split where a point is in the middle along the widest axis, few points in each leaf.
class Tree {
 public:
  explicit Tree(const std::vector<Point>& points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    if (!points.empty()) build(0, points.size());
  }

  double mean_distance(size_t index, size_t neighbors) const {
    std::vector<double> nearest;
    search(0, points_[index], index, neighbors, nearest);
    double sum = 0.0;
    for (double square : nearest) sum += std::sqrt(square);
    return sum / nearest.size();
  }

 private:
  struct Node { size_t start, end, near, far; int axis; float value; };

  static float along(const Point& point, int axis) { return axis == 0 ? point.x : axis == 1 ? point.y : point.z; }

  size_t build(size_t start, size_t end) {
    const size_t number = nodes_.size();
    nodes_.push_back({start, end, 0, 0, -1, 0.0f});
    if (end - start <= size_t(LEAF_POINTS)) return number;
    int axis = 0;
    float widest = -1.0f;
    for (int candidate = 0; candidate < 3; candidate++) {
      float low = along(points_[order_[start]], candidate), high = low;
      for (size_t place = start + 1; place < end; place++) {
        low = std::min(low, along(points_[order_[place]], candidate));
        high = std::max(high, along(points_[order_[place]], candidate));
      }
      if (high - low > widest) { widest = high - low; axis = candidate; }
    }
    const size_t middle = (start + end) / 2;
    std::nth_element(order_.begin() + start, order_.begin() + middle, order_.begin() + end,
                     [&](size_t a, size_t b) { return along(points_[a], axis) < along(points_[b], axis); });
    const float value = along(points_[order_[middle]], axis);
    const size_t near = build(start, middle), far = build(middle, end);
    nodes_[number] = {start, end, near, far, axis, value};
    return number;
  }

  void search(size_t number, const Point& point, size_t self, size_t wanted, std::vector<double>& nearest) const {
    const Node& node = nodes_[number];
    if (node.axis < 0) {
      for (size_t place = node.start; place < node.end; place++) {
        if (order_[place] == self) continue;
        const Point& other = points_[order_[place]];
        const double dx = double(other.x) - point.x, dy = double(other.y) - point.y, dz = double(other.z) - point.z;
        const double square = dx * dx + dy * dy + dz * dz;
        if (nearest.size() == wanted && square >= nearest.back()) continue;
        if (nearest.size() == wanted) nearest.pop_back();
        nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), square), square);
      }
      return;
    }
    const double distance = double(along(point, node.axis)) - node.value;
    search(distance < 0.0 ? node.near : node.far, point, self, wanted, nearest);
    if (nearest.size() < wanted || distance * distance < nearest.back()) {
      search(distance < 0.0 ? node.far : node.near, point, self, wanted, nearest);
    }
  }

  const std::vector<Point>& points_;
  std::vector<size_t> order_;
  std::vector<Node> nodes_;
};

static Cloud cleaned(const Cloud& cloud) {
  const size_t number = cloud.size();
  if (number < 3) return cloud;
  const Tree tree(cloud);
  std::vector<double> means(number);
  double sum = 0.0, squares = 0.0;
  for (size_t index = 0; index < number; index++) {
    means[index] = tree.mean_distance(index, std::min(size_t(NEIGHBORS), number - 1));
    sum += means[index];
    squares += means[index] * means[index];
  }
  const double mean = sum / number, deviation = std::sqrt((squares - sum * sum / number) / (number - 1));
  Cloud kept;
  for (size_t index = 0; index < number; index++) {
    if (means[index] <= mean + DEVIATIONS * deviation) kept.push_back(cloud[index]);
  }
  return kept;
}

struct Block {
  double mean[4], squares[4], bottom, top, count;

  void merge(const Block& other) {
    const double total = count + other.count;
    for (int value = 0; value < 4; value++) {
      const double shift = other.mean[value] - mean[value];
      squares[value] += other.squares[value] + shift * shift * count * other.count / total;
      mean[value] += shift * other.count / total;
    }
    bottom = std::min(bottom, other.bottom);
    top = std::max(top, other.top);
    count = total;
  }
};

struct Map {
  std::unordered_map<int64_t, std::vector<Block>> cells;

  void insert(const Point& point) {
    const int64_t column = std::floor(point.x / RESOLUTION), row = std::floor(point.y / RESOLUTION);
    std::vector<Block>& blocks = cells[column * (int64_t(1) << 32) + row];
    Block block = {{point.x, point.y, point.z, point.strength}, {0.0, 0.0, 0.0, 0.0}, point.z, point.z, 1.0};
    for (size_t place = 0; place < blocks.size();) {
      if (point.z - blocks[place].top >= RESOLUTION || blocks[place].bottom - point.z >= RESOLUTION) {
        place++;
        continue;
      }
      block.merge(blocks[place]);
      blocks.erase(blocks.begin() + place);
    }
    blocks.push_back(block);
  }
};

// visualization_msgs/Marker of one cube, without the fields that stay empty.
struct Marker {
  uint32_t seq, sec, nsec;
  std::string frame_id, ns;
  int32_t id, type, action;
  double position[3], orientation[4], scale[3];
  float color[4];
};

static std::vector<Marker> markers(const Map& map) {
  std::vector<Marker> all;
  int32_t id = 0;
  for (const auto& cell : map.cells) {
    const int64_t row = int32_t(cell.first & 0xffffffff), column = (cell.first - row) >> 32;
    for (const Block& block : cell.second) {
      const double depth = block.top - block.bottom;
      const bool is_vertical = depth >= RESOLUTION;
      Marker marker = {0, 0, 0, "map", is_vertical ? "vertical" : "horizontal", id++, 1, 0,
                       {(column + 0.5) * RESOLUTION, (row + 0.5) * RESOLUTION, (block.top + block.bottom) / 2.0},
                       {0.0, 0.0, 0.0, 1.0}, {RESOLUTION, RESOLUTION, std::max(depth, 0.02)}, {1.0f, 0.9f, 0.4f, 1.0f}};
      all.push_back(marker);
    }
  }
  return all;
}

static void put(std::vector<uint8_t>& bytes, const void* data, size_t size) {
  bytes.insert(bytes.end(), static_cast<const uint8_t*>(data), static_cast<const uint8_t*>(data) + size);
}

static void put(std::vector<uint8_t>& bytes, const std::string& text) {
  const uint32_t size = text.size();
  put(bytes, &size, 4);
  put(bytes, text.data(), size);
}

static std::vector<uint8_t> serialised(const std::vector<Marker>& all) {
  std::vector<uint8_t> bytes;
  const uint32_t number = all.size();
  const uint8_t empty[8 + 1 + 4 * 4 + 1] = {0};
  bytes.reserve(200 * all.size());
  put(bytes, &number, 4);
  for (const Marker& marker : all) {
    put(bytes, &marker.seq, 12);
    put(bytes, marker.frame_id);
    put(bytes, marker.ns);
    put(bytes, &marker.id, 12);
    put(bytes, marker.position, 80);
    put(bytes, marker.color, 16);
    put(bytes, empty, sizeof empty);
  }
  return bytes;
}

static std::vector<std::vector<Beam>> read(const char* path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::vector<Beam>> scans(1);
  Beam beam;
  while (file.read(reinterpret_cast<char*>(&beam.pose), 18 * sizeof(double))) {
    int32_t bins;
    file.read(reinterpret_cast<char*>(&bins), 4);
    if (bins == 0) { scans.emplace_back(); continue; }
    beam.strengths.resize(bins);
    file.read(reinterpret_cast<char*>(beam.strengths.data()), bins);
    scans.back().push_back(beam);
  }
  scans.pop_back();
  return scans;
}

int main(int, char** arguments) {
  Map map;
  double seconds[5] = {0.0};
  size_t points = 0;
  for (const std::vector<Beam>& beams : read(arguments[1])) {
    double times[6] = {cpu_seconds()};
    const Cloud cloud = projected(beams);
    times[1] = cpu_seconds();
    const Cloud strong = thresholded(cloud);
    times[2] = cpu_seconds();
    const Cloud kept = cleaned(strong);
    times[3] = cpu_seconds();
    for (const Point& point : kept) map.insert(point);
    times[4] = cpu_seconds();
    serialised(markers(map));
    times[5] = cpu_seconds();
    for (int stage = 0; stage < 5; stage++) seconds[stage] += times[stage + 1] - times[stage];
    points += kept.size();
  }
  size_t blocks = 0;
  for (const auto& cell : map.cells) blocks += cell.second.size();
  for (double stage : seconds) std::printf("%.9f ", stage);
  std::printf("%zu %zu\n", points, blocks);
}
