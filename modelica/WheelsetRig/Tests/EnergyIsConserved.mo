within WheelsetRig.Tests;
model EnergyIsConserved "Without dampers, brakes, losses and friction the rig keeps its energy"
  Reference rig(
    muWR(min=0.0)=1e-15, pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0,
    redeclare Losses.NoLoss wheelsetLoss, redeclare Losses.NoLoss rollerLoss,
    primary(each d=0.0), axleBox(each d=zeros(3), each dRot=zeros(3)),
    unit(each d=0.0, each dPitch=0.0), longitudinal(each d=0.0), vertical(each d=0.0),
    lateral(d=0.0), guide(dRot=zeros(3)), contact(each d=0.0),
    omegaW(start=80.0),
    frameMotion(v(start={0.05, 0.05, 0.1}), w(start={0.05, 0.02, 0.05})),
    wheelset(v(start={0.0, 0.05, 0.0}), omegaZ(start=0.05)));
  parameter Units.Energy disturbance = 0.5*rig.mF*(0.05^2 + 0.05^2 + 0.1^2)
    "Kinetic energy of the frame's push at the start";
  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  constant Units.Energy nominal = 1.0 "Nominal value of gain, to which a solver applies its tolerance";
  output Units.Energy gain(start=0.0, fixed=true) "Energy gained since the start";
equation
  der(gain) = der(rig.energy);
  // 1e-9: rounding of the sum of powers; friction of 1e-15 takes 1e-10 of the push. A solver may err
  // by its tolerance in each of some thousand steps.
  assert(abs(gain) < 1e-9*disturbance + 1000.0*tolerance*nominal, "Energy is not conserved");
  annotation (experiment(StopTime=1.0, Tolerance=1e-10));
end EnergyIsConserved;
