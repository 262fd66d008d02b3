within TrainRig.Tests;
model StiffCouplerIsRigid "With a stiff coupler the reference model stops as the train with one speed"
  Real pressure(unit="Pa") = 2.4e5*(1.0 - exp(-time/0.45)) "Of the first vehicle, twice that of the second";
  Reference coupled(
    coupler(each c=1e9, each d=5e6), pB1=pressure, pB2=pressure, pB3=0.5*pressure, pB4=0.5*pressure,
    mass1=46e3, mass2=54e3, slope1=4e-3, slope2=6e-3, curve=5e-4,
    vehicle(each v(start=30.0)), axle(each omega(start=65.2)));
  TwoVehicles rigid(
    pB1=pressure, pB2=pressure, pB3=0.5*pressure, pB4=0.5*pressure, mass1=46e3, mass2=54e3,
    slope1=4e-3, slope2=6e-3, curve=5e-4, dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0,
    dmuDC5=0.0, dmuDC6=0.0, dmuDC7=0.0, dmuDC8=0.0, dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0,
    dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0, vTrain(start=30.0), omega1(start=65.2),
    omega2(start=65.2), omega3(start=65.2), omega4(start=65.2), omega5(start=65.2),
    omega6(start=65.2), omega7(start=65.2), omega8(start=65.2));
equation
  // Loads by forces, not by pads, move slip by less than a hundredth of itself, 0.04 m/s.
  assert(abs(coupled.vTrain - rigid.vTrain) < 4e-4, "The train stops otherwise");
  assert(abs(coupled.omega8 - rigid.omega8) < 1e-3, "Its last axle turns otherwise");
  // What the second vehicle brakes less, the first holds up: the coupler is pressed.
  assert(time < 2.0 or abs(coupled.tension - (54e3*(rigid.acceleration + 9.81*(6e-3 + 5e-4))
    + rigid.Fx[5] + rigid.Fx[6] + rigid.Fx[7] + rigid.Fx[8]
    + 0.54*(1100.0 + 12.0*rigid.v + 5.5*rigid.v^2))) < 50.0, "Not the force of a rigid coupling");
  assert(time < 2.0 or coupled.tension < -1e3, "The coupler is not pressed");
  assert(time < 15.0 or rigid.v < 25.0, "The train does not slow down");
  annotation (experiment(StopTime=18.0, Tolerance=1e-7));
end StiffCouplerIsRigid;
