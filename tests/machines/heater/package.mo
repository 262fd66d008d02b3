within ;
package Heater "A heated block in a casing"
  partial model PartialLoss "Slot: from temperature to heat"
    input Real T(unit="K") "Above the surroundings";
    output Real Q(unit="W") "Lost";
  end PartialLoss;

  model NoLoss "Null version"
    extends PartialLoss;
  equation
    Q = 0.0;
  end NoLoss;

  model Draught "a draught that takes heat"
    extends PartialLoss;
    parameter Real G(unit="W/K", min=0.0, max=5.0) = 0.0 "Conductance";
  equation
    Q = G*T;
    annotation (__Workbench(effect(
      size="G", matters=0.02, separation="the surface in a closed box")));
  end Draught;

  model Radiation "heat that is radiated"
    extends PartialLoss;
    parameter Real s(unit="W/K2", min=0.0, max=0.1) = 0.0 "Quadratic part";
  equation
    Q = s*T*abs(T);
    annotation (__Workbench(effect(
      size="s", matters=5e-4, separation="a hotter block")));
  end Radiation;

  model Observer "Block and casing"
    parameter Real C(unit="J/K") = 100.0 "Heat capacity of the block";
    parameter Real Cc(unit="J/K") = 200.0 "Heat capacity of the casing";
    parameter Real K(unit="W/K") = 2.0 "From block to casing";
    parameter Real Gc(unit="W/K") = 0.5 "From casing to the surroundings";
    input Real P(unit="W") "Heating power";
    input Real dGc(unit="W/K") "Correction of Gc";
    output Real T(unit="K", start=0.0, fixed=true, nominal=20.0) "Block";
    Real Tc(unit="K", start=0.0, fixed=true, nominal=20.0) "Casing";
    replaceable NoLoss loss(T=T) constrainedby PartialLoss(T=T) "From the block";
  equation
    C*der(T) = P - K*(T - Tc) - loss.Q;
    Cc*der(Tc) = K*(T - Tc) - (Gc + dGc)*Tc;
  end Observer;
end Heater;
