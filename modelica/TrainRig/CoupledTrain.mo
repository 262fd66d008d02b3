within TrainRig;
partial model CoupledTrain "Longitudinal dynamics of vehicles with couplers"
  parameter Integer vehicles = 2 "Vehicles, of two bogies each";
  final parameter Integer n = 4*vehicles "Axles";
  parameter Real between[n - 1](each unit="m", each min=0.1) = fill(2.5, n - 1)
    "Distance of an axle from the next";
  parameter Real A(unit="N", min=0.0) = 1100.0 "Running resistance at rest";
  parameter Real B(unit="N.s/m", min=0.0) = 12.0 "Its growth with speed";
  parameter Real C(unit="N.s2/m2", min=0.0) = 5.5 "Resistance of the air";
  parameter Real muWR(unit="1", min=0.02, max=1.0) = 0.40 "Friction wheel-rail at the first axle";
  constant Real g(unit="m/s2") = 9.81 "Gravity";
  Real p[2*vehicles](each unit="Pa") "Pressure behind the valve of a bogie";
  Real m[vehicles](each unit="kg") "Mass of a vehicle";
  Real slope[vehicles](each unit="1") "Gradient under the middle of a vehicle";
  Real curves(unit="1") "Resistance of curves over weight";
  Parts.Vehicle vehicle[vehicles] "Vehicles";
  Parts.Coupler coupler[vehicles - 1] "Between a vehicle and the next";
  Parts.Axle axle[n] "Axles";
  Parts.Rail rail[n - 1](length=between, each muStart=muWR) "Between an axle and the next";
  Real energy(unit="J") "Kinetic energy, and that of couplers";
  Real taken(unit="W") "Power of all that slows the train";
protected
  Real resistance[vehicles](each unit="N") "Of air, curves and gradients";
equation
  for k in 1:vehicles - 1 loop
    connect(vehicle[k].rear, coupler[k].front);
    connect(coupler[k].rear, vehicle[k + 1].front);
  end for;
  for k in 1:vehicles loop
    vehicle[k].m = m[k];
    vehicle[k].resistance = resistance[k];
    resistance[k] = m[k]/sum(m)*(A + B*vehicle[k].v + C*vehicle[k].v*noEvent(abs(vehicle[k].v)))
      *tanh(vehicle[k].v/0.01) + m[k]*g*(slope[k] + curves*tanh(vehicle[k].v/0.01));
    for i in 1:4 loop
      vehicle[k].Fx[i] = axle[4*k + i - 4].Fx;
      axle[4*k + i - 4].Q = vehicle[k].Q[i];
      axle[4*k + i - 4].v = vehicle[k].v;
    end for;
    for i in 1:2 loop
      axle[4*k + i - 4].p = p[2*k - 1];
      axle[4*k + i - 2].p = p[2*k];
    end for;
  end for;
  axle[1].mu0 = muWR;
  for i in 1:n - 1 loop
    rail[i].v = axle[i].v;
    rail[i].mu = axle[i].mu0;
    rail[i].work = axle[i].work;
    axle[i + 1].mu0 = rail[i].next;
  end for;
  energy = sum(0.5*m[k]*vehicle[k].v^2 for k in 1:vehicles)
    + sum(0.5*axle[i].J*axle[i].omega^2 for i in 1:n)
    + sum(coupler[k].energy for k in 1:vehicles - 1);
  taken = sum(sum(axle[i].discPower) + axle[i].slipPower + axle[i].lossPower for i in 1:n)
    + sum(resistance[k]*vehicle[k].v for k in 1:vehicles)
    + sum(coupler[k].lossPower for k in 1:vehicles - 1);
  annotation (Documentation(info="<html>
<p>Vehicles, axles, couplers and rail of <code>Parts</code>, by the data sheet of the train. Axles find the rail as those
before have left it.</p>
<h4>Limitations</h4>
<p>Along the track alone. All axles begin on rail of the same friction. Resistances act on vehicles by their
mass.</p>
<h4>References</h4>
<p>O. Polach (2005), Wear 258, 992-1000; EN 14531-1 for the resistances.</p>
</html>"));
end CoupledTrain;
