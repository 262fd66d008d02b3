within TrainRig;
partial model Train "Longitudinal dynamics of a train with rigid couplings"
  parameter Integer vehicles = 2 "Vehicles, of two bogies each";
  final parameter Integer bogies = 2*vehicles "Bogies, of two axles each";
  final parameter Integer n = 4*vehicles "Axles";
  parameter Real r[n](each unit="m", each min=0.3, each max=0.6) = fill(0.46, n) "Wheel radius";
  parameter Real JW(unit="kg.m2", min=1.0) = 110.0 "Inertia of a wheelset about its axle";
  parameter Real rB(unit="m", min=0.1) = 0.30 "Radius at which the pads act";
  parameter Real units(unit="1", min=0.0) = 3.0 "Brake units of an axle, one disc each";
  parameter Real muDC[n](each unit="1", each min=0.0, each max=1.0) = fill(0.30, n)
    "Friction of an axle's pads";
  parameter Real pads(unit="1", min=0.1, max=3.0) = 1.0 "Friction of all pads, of the usual one";
  parameter Real speedLaw(unit="1", min=-0.5, max=0.5) = 0.20
    "Relative fall of the pads' friction from standstill to vRef";
  parameter Real vRef(unit="m/s", min=1.0) = 22.0 "Speed at which it is muDC";
  parameter Real exponent(unit="1", min=0.0, max=0.1) = 0.02 "Of the fall with the pads' force";
  parameter Real fade(unit="1/K", min=0.0, max=2e-3) = 3e-4 "Relative fall with temperature";
  parameter Real perPressure(unit="N/Pa", min=0.0) = 0.1086 "Force of a pad per pressure";
  parameter Real pRelease(unit="Pa", min=0.0) = 25000.0 "Pressure below which springs hold pads off";
  parameter Real K0(unit="N", min=1.0) = 12.4e6
    "Creep force of one wheel per creepage at zero slip, at 80 kN";
  parameter Real profile[n](each unit="1", each min=0.5, each max=2.0) = fill(1.0, n)
    "Share of K0 that the profiles of an axle's wheels have";
  parameter Real share[n](each unit="1", each min=0.5, each max=1.5) = fill(1.0, n)
    "Share of an axle in its vehicle's weight, of a quarter";
  parameter Real muWR(unit="1", min=0.02, max=1.0) = 0.40 "Friction wheel-rail at zero slip";
  parameter Rig.Contact.PolachParameters polach "Law of the creep force";
  parameter Real A(unit="N", min=0.0) = 1100.0 "Running resistance at rest";
  parameter Real B(unit="N.s/m", min=0.0) = 12.0 "Its growth with speed";
  parameter Real C(unit="N.s2/m2", min=0.0) = 5.5 "Resistance of the air";
  parameter Real mass[vehicles](each unit="1", each min=0.5, each max=2.0) = fill(1.0, vehicles)
    "Mass of a vehicle, of the weighed one";
  parameter Real gradientError(unit="1", min=-0.02, max=0.02) = 0.0
    "True gradient less that of the track file";
  parameter Real bias(unit="m/s2", min=-1.0, max=1.0) = 0.0 "Of the accelerometer, at rest";
  parameter Real sensitivity(unit="1", min=0.1, max=2.0) = 1.0
    "Reading of the accelerometer over the acceleration";
  parameter Real omega0(unit="rad/s", min=1e-6) = 0.05 "Speed below which torques are smoothed";
  constant Real g(unit="m/s2") = 9.81 "Gravity";

  Real pC[bogies](each unit="Pa") "Pressure in the cylinders of a bogie";
  Real ordinary[n](each unit="1") "Friction of ordinary pads";
  Real mu[n](each unit="1") "Friction that acts";
  Real acting[n](each unit="1") "Brake units that act";
  Real drag[n](each unit="N.m") "Torque on an axle beside braked pads and its losses";
  Real rA[n](each unit="m") "Wheel radius that acts";
  Real m[vehicles](each unit="kg") "Mass of a vehicle";
  Real mu0(unit="1") "Friction wheel-rail that acts";
  Real rest(unit="N") "Running resistance at rest that acts";
  Real air(unit="N.s2/m2") "Resistance of the air that acts";
  Real slope[vehicles](each unit="1") "Gradient under the middle of a vehicle";
  Real uphill(unit="1") "Gradient under the train that acts";
  Real curves(unit="1") "Resistance of curves over weight";
  Real dmuDC[n](each unit="1") "Correction of muDC";
  Real omega[n](each unit="rad/s") "Angular velocity of an axle";
  Real rate[n](each unit="rad/s2") "Rate of omega";
  Real v(unit="m/s") "Speed of the train";
  Real acceleration(unit="m/s2") "Rate of v";
  Real felt(unit="m/s2") "What an accelerometer in the first vehicle feels";
  Real Fx[n](each unit="N") "Creep force of both wheels of an axle, braking";
  output Real axleForce[n](each unit="N") = Fx "The same, of which an observer reports";
  output Real utilised[n](each unit="1") "Adhesion that an axle uses, of the load that acts";
  Real tauB[n](each unit="N.m") "Torque of an axle's pads";
  Real Q[n](each unit="N") "Load of one wheel";
  Real T[n](each unit="K", each start=323.15, each fixed=true, each nominal=300.0)
    "Temperature of an axle's discs";
  Real frictionPower[n](each unit="W") "Of an axle's pads";
  Real slipPower[n](each unit="W") "Of an axle's contacts";
  Real lossPower[n](each unit="W") "Of an axle's bearings, discs and drag";
  Real braking(unit="m/s2") "Deceleration for which wheel loads have shifted";
protected
  Real Fperp[n](each unit="N") "Force of a pad pair";
  Real weight(unit="kg") "Mass of the train";
  Real cooling(unit="W/K") "Of one disc";
  Real tauL[n](each unit="N.m") "Losses of an axle, without drag";
equation
  weight = sum(m);
  cooling = 1.1*(25.0 + 8.0*((0.65*v)^2 + 1e-4)^0.4);
  for k in 1:vehicles loop
    for j in 1:2 loop
      for i in 1:2 loop
        Fperp[4*k + 2*j + i - 6] =
          perPressure*noEvent(max(0.0, pC[2*k + j - 2] - pRelease));
        // By torques, in place of the forces that follow from loads themselves.
        Q[4*k + 2*j + i - 6] = 0.5*(m[k]*(g/4.0*share[4*k + 2*j + i - 6] + braking*1.3/38.0*(3 - 2*j))
          + (tauB[4*k + 2*j - 5] + tauB[4*k + 2*j - 4])/0.46*0.2*(3 - 2*i));
      end for;
    end for;
  end for;
  for i in 1:n loop
    ordinary[i] = ordinaryFriction(
      (muDC[i] + dmuDC[i])*pads, v, Fperp[i], T[i], speedLaw, vRef, exponent, fade);
    tauB[i] = acting[i]*mu[i]*Fperp[i]*rB;
    Fx[i] = 2.0*Rig.Contact.creepForce(
      v - rA[i]*omega[i], v, Q[i], Rig.Contact.kalkerStiffness(Q[i], K0*profile[i], 80000.0),
      mu0, polach);
    tauL[i] = 25.0 + 0.6*noEvent(abs(omega[i])) + 0.004*omega[i]^2;
    JW*rate[i] = rA[i]*Fx[i] - (tauB[i] + tauL[i])*tanh(omega[i]/omega0) - drag[i];
    utilised[i] = Fx[i]/(2.0*Q[i]);
    frictionPower[i] = tauB[i]*omega[i]*tanh(omega[i]/omega0);
    slipPower[i] = Fx[i]*(v - rA[i]*omega[i]);
    lossPower[i] = (tauL[i]*tanh(omega[i]/omega0) + drag[i])*omega[i];
    units*37500.0*der(T[i]) = 0.93*frictionPower[i] - units*cooling*(T[i] - 293.15);
  end for;
  weight*acceleration = -sum(Fx) - (rest + B*v + air*v*noEvent(abs(v)))*tanh(v/0.01)
    - g*weight*(uphill + curves*tanh(v/0.01));
  felt = sensitivity*(acceleration + g*slope[1]) + bias;
  annotation (Documentation(info="<html>
<p><code>m*v' = -sum(Fx) - R(v) - g*m*(gradient + curves)</code>, <code>JW*omega' = r*Fx - tauB -
losses</code>, Polach's law for <code>Fx</code>. Pads rub by an affine law of speed, a power of force and
a linear one of temperature; the discs of an axle have one temperature.</p>
<h4>Limitations</h4>
<p>One speed for all vehicles. Wheel loads shift with the torques of a bogie's pads, and with a deceleration
that the extending model chooses, <code>braking</code>. There is no slide protection: the pressure of a bogie is
that of both its axles.</p>
<h4>References</h4>
<p>O. Polach (2005), Wear 258, 992-1000; EN 14531-1 for the resistances.</p>
</html>"));
end Train;
