# source scripts/env.bash: roslaunch, rosrun and rosbag of this shell find the package.
# The virtual environment comes first on the PATH so that "env python3" is the Python that ROS was built for.
_umc_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [ ! -f "$_umc_root/build/workspace/devel/setup.bash" ]; then
  echo "env.bash: not built yet; run scripts/bootstrap first" >&2
  unset _umc_root
  return 1
fi
_umc_nounset=$(set +o | grep nounset)
set +u
# In a function, or catkin's setup would take the arguments of the script that sources this one for its own.
_umc_setup() { source "$_umc_root/build/workspace/devel/setup.bash"; }
_umc_setup
eval "$_umc_nounset"
export PATH="$_umc_root/build/venv/bin:$PATH"
export ROS_PYTHON_VERSION=3
unset _umc_root _umc_nounset
unset -f _umc_setup
