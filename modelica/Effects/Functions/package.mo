within Effects;
package Functions "Smooth forms of kinks"
end Functions;
