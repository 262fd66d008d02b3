within Effects.Tests;
model LateSignalsFollowARamp "Delay and lag shift a ramp by their time"
  Real u(start=0.0, fixed=true) "A ramp";
  Signals.Delay late(u=u, delay=0.03);
  Signals.Delay early(u=u, delay=-0.03);
  Signals.Lag lagging(u=u, lag=0.2);
equation
  der(u) = 5.0;
  // After 3 s the start is forgotten: exp(-3/0.2) is 3e-7.
  assert(time < 3.0 or abs(late.y - (u - 0.15)) < 1e-6, "Not late by 30 ms");
  assert(time < 3.0 or abs(early.y - (u + 0.15)) < 1e-6, "Not early by 30 ms");
  assert(time < 3.0 or abs(lagging.y - (u - 1.0)) < 1e-5, "Not late by 200 ms");
  annotation (experiment(StopTime=4.0, Tolerance=1e-8));
end LateSignalsFollowARamp;
