within ServoPendulum.Tests;
model ArmRestsWhereTorquesBalance "The controller holds the arm where motor and weight balance"
  parameter Real goal = 0.8 "Held";
  Servo servo(goal=goal, volts=7.4, enabled=1.0, dtauF=0.0);
  Servo strong(goal=goal, volts=7.4, enabled=1.0, dtauF=0.0, kp=8000.0);
  Servo overdriven(goal=3.0, volts=2.0, enabled=1.0, dtauF=0.0, kp=8000.0);
protected
  Real k = 0.37/4.0*7.4*400.0*4096.0/(2.0*3.141592653589793*256.0*885.0) "Torque per error";
equation
  // Back-EMF damps the arm within 0.5 s: exp(-10/0.5) is below 1e-8.
  assert(time < 10.0 or abs(
    k*(goal - servo.position) - 0.49*9.80665*0.1*sin(servo.position + 0.02)) < 1e-6,
    "Torques do not balance");
  assert(time < 10.0 or abs(strong.position - goal) < 0.05, "A strong controller is far off");
  // Full duty at 2 V: 0.185 N.m of the 0.481 that a level arm takes.
  assert(time < 10.0 or abs(sin(overdriven.position + 0.02) - 0.37/4.0*2.0/0.4805259) < 1e-5,
    "The duty exceeds 1");
  annotation (experiment(StopTime=12.0, Tolerance=1e-8));
end ArmRestsWhereTorquesBalance;
