within WheelsetRig;
package Contact "Wheel-rail contact after Polach"
  annotation (Documentation(info="<html>
<p>Longitudinal creep force between wheel and roller. Lateral creep and spin are neglected.</p>
</html>"));
end Contact;
