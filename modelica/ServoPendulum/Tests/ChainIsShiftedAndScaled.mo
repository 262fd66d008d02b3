within ServoPendulum.Tests;
model ChainIsShiftedAndScaled "Gains, delays and play of the signals around the arm"
  Real angle = 0.5*time "Of a shaft that turns steadily";
  Signals.CommandLag goal(u=angle, lag=0.02);
  Signals.ReadingDelay reading(u=angle, delay=0.01);
  Signals.Play play(u=angle, play=0.03);
  Signals.HeavierArm arm(u=0.48, gain=0.05);
  Drive.ControllerGain controller(u=0.2, gain=-0.5);
equation
  // After 1 s the start is forgotten: exp(-1/0.023) is below 1e-12.
  assert(time < 1.0 or abs(goal.y - (angle - 0.5*0.02)) < 1e-7, "The goal is not late by 20 ms");
  assert(time < 1.0 or abs(reading.y - (angle - 0.5*0.01)) < 1e-7, "Not late by 10 ms");
  assert(time < 3.0 or abs(play.y - (angle - 0.03)) < 1e-3, "The play is not taken up");
  assert(abs(arm.y - 0.504) < 1e-12 and abs(controller.y - 0.1) < 1e-12, "Gains");
  annotation (experiment(StopTime=4.0, Tolerance=1e-8));
end ChainIsShiftedAndScaled;
