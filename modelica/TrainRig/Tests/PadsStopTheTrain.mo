within TrainRig.Tests;
model PadsStopTheTrain "Constant pads alone: speed falls in proportion to time, slip follows the force"
  TwoVehicles train(
    speedLaw=0.0, exponent=0.0, fade=0.0, A=0.0, B=0.0, C=0.0,
    pB1=2.25e5, pB2=2.25e5, pB3=2.25e5, pB4=2.25e5, mass1=50e3, mass2=50e3, slope1=0.0, slope2=0.0,
    curve=0.0, dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0, dmuDC5=0.0, dmuDC6=0.0, dmuDC7=0.0,
    dmuDC8=0.0,
    dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0, dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0,
    vTrain(start=30.0), omega1(start=65.0), omega2(start=65.0), omega3(start=65.0),
    omega4(start=65.0), omega5(start=65.0), omega6(start=65.0), omega7(start=65.0),
    omega8(start=65.0), T(each start=293.15));
protected
  // Three pairs with 21.72 kN each, at 0.3 m; bearings at 60 rad/s.
  parameter Real tau(unit="N.m") = 3.0*0.30*21720.0*0.30;
  parameter Real expected(unit="m/s2") = (8.0*(tau + 75.4)/0.46)/(100e3 + 8.0*110.0/0.46^2);
  Real force(unit="N") = (tau + 75.4 - 110.0*expected/0.46)/0.46 "Of one axle";
  constant Real pi = 3.141592653589793;
  parameter Real Q(unit="N") = 50e3*9.81/8.0 "Of one wheel";
  Real w(unit="m/s") = train.v - 0.46*sum(train.omega)/8.0 "Mean slip";
  Real mu(unit="1") = 0.4*(0.6*exp(-0.6*w) + 0.4);
  Real eps(unit="1") = pi*12.4e6*(Q/80e3)^(2.0/3.0)*w/(4.0*Q*mu*train.v);
equation
  // Bearings take 75.4 N.m at 60 rad/s and from 60 to 82 along the way: 7 of 5900 N.m.
  assert(time < 1.0 or abs(-train.acceleration/expected - 1.0) < 3e-3, "Not the deceleration of pads");
  // Polach's law at the mean slip: loads of axles shift by five percent, which squares to a part in
  // a hundred.
  assert(time < 1.0 or abs(2.0*2.0*Q*mu/pi*(eps/(1.0 + eps^2) + atan(0.4*eps))/force - 1.0) < 0.01,
    "Slip does not follow from the force");
  assert(abs(train.felt - train.acceleration) < 1e-12, "On level track the accelerometer feels v'");
  annotation (experiment(StopTime=8.0, Tolerance=1e-8));
end PadsStopTheTrain;
