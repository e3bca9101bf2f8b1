// Otsu's threshold and the removal of weaker points as a C++ programmer would write them for a cloud of PCL's layout.
// Reads points x y z strength (float32) from the file named, and prints seconds of CPU for Otsu and for both, and how
// many points are left.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <vector>

struct Point { float x, y, z, padding, strength, more[3]; };

static double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

static double otsu(const std::vector<Point>& cloud) {
  std::vector<long> histogram(256, 0);
  double sum = 0.0;
  long total = 0;
  for (const Point& point : cloud) {
    if (point.strength > 0.0f) histogram[std::min(static_cast<int>(point.strength), 255)]++;
  }
  for (int level = 0; level < 256; level++) {
    sum += static_cast<double>(level) * histogram[level];
    total += histogram[level];
  }
  double sum_below = 0.0, greatest = -1.0;
  long below = 0;
  int first = 0, last = 0;
  for (int level = 0; level < 256; level++) {
    below += histogram[level];
    sum_below += static_cast<double>(level) * histogram[level];
    const long above = total - below;
    if (below == 0 || above == 0) continue;
    const double difference = sum_below / below - (sum - sum_below) / above;
    const double between = static_cast<double>(below) * above * difference * difference;
    if (between > greatest) { greatest = between; first = level; }
    if (between >= greatest) last = level;
  }
  return (first + last) / 2.0;
}

int main(int, char** arguments) {
  std::ifstream file(arguments[1], std::ios::binary);
  std::vector<Point> cloud;
  float row[4];
  while (file.read(reinterpret_cast<char*>(row), sizeof row)) {
    cloud.push_back({row[0], row[1], row[2], 1.0f, row[3], {0.0f, 0.0f, 0.0f}});
  }
  const std::vector<double> stamps(cloud.size(), 1.0);
  std::vector<double> of_otsu, of_both;
  size_t left = 0;
  for (int turn = 0; turn < 101; turn++) {
    const double start = cpu_seconds();
    const double threshold = 1.4 * otsu(cloud);
    const double middle = cpu_seconds();
    std::vector<Point> strong;
    std::vector<double> strong_stamps;
    for (size_t index = 0; index < cloud.size(); index++) {
      if (cloud[index].strength > threshold) {
        strong.push_back(cloud[index]);
        strong_stamps.push_back(stamps[index]);
      }
    }
    of_both.push_back(cpu_seconds() - start);
    of_otsu.push_back(middle - start);
    left = strong.size();
  }
  std::nth_element(of_otsu.begin(), of_otsu.begin() + 50, of_otsu.end());
  std::nth_element(of_both.begin(), of_both.begin() + 50, of_both.end());
  std::printf("%.9f %.9f %zu\n", of_otsu[50], of_both[50], left);
}
