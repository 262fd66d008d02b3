within ServoPendulum.Tests;
model SizeZeroIsNominal "With every effect at size zero the servo moves as the nominal one"
  Real goal = 1.2*sin(2.0*time) "Reaches the limit of the duty";
  Servo nominal(goal=goal, volts=7.0, enabled=1.0, dtauF=0.0, kp=800.0);
  Servo zero(goal=goal, volts=7.0, enabled=1.0, dtauF=0.0, kp=800.0,
    redeclare Signals.CommandLag command, redeclare Drive.ControllerGain gain,
    redeclare Drive.BridgeDrop bridge, redeclare Drive.SupplyResistance resistance,
    redeclare Drive.CurrentLimit current, redeclare Signals.HeavierArm weight,
    redeclare Friction.LoadFriction friction, redeclare Friction.DriveFriction driveFriction,
    redeclare Signals.ReadingDelay encoder);
equation
  assert(abs(zero.position - nominal.position) < 1e-9, "The shaft moves otherwise");
  assert(abs(zero.reading - nominal.reading) < 1e-9, "The reading is another one");
  annotation (experiment(StopTime=3.0, Tolerance=1e-8));
end SizeZeroIsNominal;
