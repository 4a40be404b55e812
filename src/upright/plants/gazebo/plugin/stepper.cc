// A world plugin that lets another process move the cart-pole: Gazebo advances so many physics steps
// as are asked for, and waits in between (lock-step).
//
// It connects to the Unix socket that the world file names. Every request is a `Request`, every
// answer an `Answer`, in the machine's own order of bytes. When the other side closes the socket, the
// server ends.

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include <gazebo/common/Console.hh>
#include <gazebo/common/Events.hh>
#include <gazebo/common/Plugin.hh>
#include <gazebo/physics/Joint.hh>
#include <gazebo/physics/Link.hh>
#include <gazebo/physics/Model.hh>
#include <gazebo/physics/PhysicsEngine.hh>
#include <gazebo/physics/World.hh>

namespace upright
{
/// What can be asked for. `values` is a force [N] for `step`, and a state for `reset`.
struct Request
{
  enum Kind : std::uint32_t { step = 0, reset = 1 };

  std::uint32_t kind;
  std::uint32_t steps;  // physics steps to make
  double values[4];
};

/// The state: x [m], its velocity [m/s], theta [rad], its velocity [rad/s].
struct Answer
{
  double state[4];
};

constexpr int patience = 100;  // how often to look whether Gazebo stops [ms]

class Stepper : public gazebo::WorldPlugin
{
public:
  ~Stepper() override
  {
    if (socket_ >= 0)
      ::close(socket_);
  }

  void Load(gazebo::physics::WorldPtr world, sdf::ElementPtr settings) override
  {
    world_ = world;
    socket_ = connect_to(settings->Get<std::string>("socket"));
    // Blocked in `update`, Gazebo would not end by itself.
    ends_[0] = gazebo::event::Events::ConnectStop([this] { stopping_ = true; });
    ends_[1] = gazebo::event::Events::ConnectSigInt([this] { stopping_ = true; });
    begins_ = gazebo::event::Events::ConnectWorldUpdateBegin(
        [this](const gazebo::common::UpdateInfo &) { update(); });
  }

private:
  /// Push the cart in the physics step that begins; first wait for a request, if none is left.
  void update()
  {
    if (!slider_)
      find_joints();
    if (left_ == 0 && asked_)
      answer();
    while (left_ == 0)
    {
      Request request;
      if (!receive(request))
        return;
      asked_ = true;
      if (request.kind == Request::reset)
      {
        set_state(request.values);
        answer();
      }
      else
      {
        left_ = request.steps;
        force_ = request.values[0];
      }
    }
    slider_->SetForce(0, force_);
    --left_;
  }

  void find_joints()
  {
    const auto model = world_->ModelByName("cartpole");
    slider_ = model->GetJoint("slider");
    hinge_ = model->GetJoint("hinge");
    // Noise may push beyond the greatest force of a command.
    slider_->SetEffortLimit(0, -1.0);
    is_ode_ = world_->Physics()->GetType() == "ode";
    if (is_ode_)
    {
      track_ = slider_->GetParent()->WorldPose();
      cart_ = slider_->GetChild()->WorldPose();
      pole_ = hinge_->GetChild()->WorldPose();
      anchor_ = hinge_->Anchor(0);
      // Otherwise the solver begins with the forces of the last step, also after a reset.
      world_->Physics()->SetParam("warm_start_factor", 0.0);
    }
  }

  void set_state(const double (&state)[4])
  {
    const auto [x, x_dot, theta, theta_dot] = state;
    if (is_ode_)
      place(x, x_dot, theta, theta_dot);
    else
    {
      slider_->SetPosition(0, x);
      hinge_->SetPosition(0, theta);
      slider_->SetVelocity(0, x_dot);
      hinge_->SetVelocity(0, theta_dot);
    }
    // After a fall ODE's angle may be whole turns off.
    turns_ = 2 * M_PI * std::round((hinge_->Position(0) - theta) / (2 * M_PI));
  }

  /// Place the links, as ODE keeps their poses and velocities, not those of joints. Its joints let
  /// links drift apart a little, which moving a joint would leave as it is.
  void place(double x, double x_dot, double theta, double theta_dot)
  {
    const auto track = slider_->GetParent(), cart = slider_->GetChild(), pole = hinge_->GetChild();
    const ignition::math::Vector3d along(x, 0, 0);
    const ignition::math::Quaterniond lean(ignition::math::Vector3d::UnitY, theta);
    for (const auto &link : {track, cart, pole})
      link->ResetPhysicsStates();
    track->SetWorldPose(track_);
    cart->SetWorldPose({cart_.Pos() + along, cart_.Rot()});
    pole->SetWorldPose({anchor_ + along + lean * (pole_.Pos() - anchor_), lean * pole_.Rot()});
    // Velocities are those of centres of mass.
    const double arm = pole->GetInertial()->CoG().Length();
    cart->SetWorldTwist({x_dot, 0, 0}, {0, 0, 0});
    const double across = x_dot + theta_dot * arm * std::cos(theta);
    pole->SetWorldTwist({across, 0, -theta_dot * arm * std::sin(theta)}, {0, theta_dot, 0});
  }

  void answer()
  {
    asked_ = false;
    const Answer answer{{slider_->Position(0), slider_->GetVelocity(0),
                         hinge_->Position(0) - turns_, hinge_->GetVelocity(0)}};
    if (::send(socket_, &answer, sizeof answer, MSG_NOSIGNAL) != sizeof answer)
      end("the other side is gone");
  }

  /// Wait for a request; return whether there is one, else Gazebo is stopping.
  bool receive(Request &request)
  {
    pollfd ready{socket_, POLLIN, 0};
    while (!stopping_)
    {
      if (::poll(&ready, 1, patience) <= 0)
        continue;
      if (::recv(socket_, &request, sizeof request, MSG_WAITALL) != sizeof request)
        end("the other side is gone");
      return true;
    }
    return false;
  }

  static int connect_to(const std::string &path)
  {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    const int handle = ::socket(AF_UNIX, SOCK_STREAM, 0);
    if (::connect(handle, reinterpret_cast<sockaddr *>(&address), sizeof address) != 0)
      end("nobody listens at " + path);
    return handle;
  }

  /// End the server at once: there is nothing to save, and it has no other use.
  [[noreturn]] static void end(const std::string &why)
  {
    gzmsg << "upright: " << why << std::endl;
    std::_Exit(EXIT_SUCCESS);
  }

  gazebo::physics::WorldPtr world_;
  gazebo::physics::JointPtr slider_, hinge_;
  ignition::math::Pose3d track_, cart_, pole_;  // where the links are with both joints at 0
  ignition::math::Vector3d anchor_;     // where the hinge is then
  bool is_ode_ = false;
  gazebo::event::ConnectionPtr begins_, ends_[2];
  std::atomic<bool> stopping_{false};
  int socket_ = -1;
  std::uint32_t left_ = 0;  // physics steps still to make
  bool asked_ = false;      // whether somebody waits for an answer
  double force_ = 0.0;      // [N]
  double turns_ = 0.0;      // what the hinge's angle has too much [rad]
};
}  // namespace upright

using upright::Stepper;
GZ_REGISTER_WORLD_PLUGIN(Stepper)
