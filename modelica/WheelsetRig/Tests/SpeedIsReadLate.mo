within WheelsetRig.Tests;
model SpeedIsReadLate "A delayed sensor reads the speed of a moment ago"
  Units.AngularVelocity omega = 80.0 - 5.0*time "Of a wheelset in a stop";
  Sensors.SpeedSignalDelay late(u=omega, delay=0.008);
  Sensors.SpeedSignalDelay filtered(u=late.y, delay=0.015);
  Sensors.SpeedSignalDelay early(u=omega, delay=-0.015);
equation
  // After 0.5 s the start is forgotten: exp(-0.5/0.018) of 0.1 rad/s is below 1e-12.
  assert(time < 0.5 or abs(late.y - (omega + 5.0*0.008)) < 1e-7, "Delay of 8 ms");
  assert(time < 0.5 or abs(filtered.y - (omega + 5.0*0.023)) < 1e-7, "Delays do not add up");
  assert(time < 0.5 or abs(early.y - (omega - 5.0*0.015)) < 1e-7, "Clock of 15 ms ahead");
  annotation (experiment(StopTime=1.0, Tolerance=1e-8));
end SpeedIsReadLate;
